// stages/heights/build_steps.h: whether the build vat of a powder printer can make a table of layers.
#pragma once

#include <string>

#include "stages/data/machine.h"
#include "stages/data/status.h"
#include "stages/heights/table.h"

namespace lamina::heights {

/// Empty, or a warning if some layers end between two steps of the vat.
/// errors  kUsage: a layer thinner than a step
/// cost    O(layers)
Result<std::string> check_build_steps(const Machine& machine, const LayerTable& table);

}  // namespace lamina::heights
