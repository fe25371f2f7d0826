// stages/load/diagnosis/repeats.h: facets that a mesh has twice; internal to load.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/load/repair/vertices.h"

namespace lamina::load {

/// Of some facets, those that an earlier one of them in the list has the same corners as, in the same orientation; each once,
/// in no order. A facet that uses a vertex twice has no orientation. facets: is overwritten
std::vector<std::uint32_t> repeats_among(const Numbered& mesh, std::vector<std::uint32_t>& facets);

}  // namespace lamina::load
