// stages/replay/feeding.h: what a machine has to feed, and what it used up.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "stages/data/machine.h"
#include "stages/replay/count.h"

namespace lamina::replay {

/// Which vats have to feed a layer, a bit each, by the machine's rule; 0 where the rule refuses. An empty layer is of the
/// first material.
/// set  pixels of each material
/// vat  of each material
std::uint32_t vats_wanted(const Machine& machine, std::span<const std::uint64_t> set, std::span<const std::uint32_t> vat);

/// "both vats feed"
std::string vats_text(std::uint32_t vats);

Material material_of(const Machine& machine, const Count& count);

}  // namespace lamina::replay
