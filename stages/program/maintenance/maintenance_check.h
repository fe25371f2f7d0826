// stages/program/maintenance/maintenance_check.h: whether a dialect can say the care that a profile asks for, and a machine can
// take it.
#pragma once

#include <vector>

#include "stages/program/dialect.h"

namespace lamina::program {

/// Whether a dialect can say what a profile asks for beside drops and powder, and whether it can be done: places off the bed,
/// limits in seconds that the longest sweep keeps. errors  kUsage, with the key and what to do
Status check_maintenance(const Dialect& dialect, const Machine& machine, const HeadGrid& grid);

/// Warns of what a profile has places for and never requests, and of head maintenance that does not go together: a lamp that
/// is switched on and never off, a pause without a cap that is longer than nozzles may wait.
void warn_of_idle_maintenance(const Machine& machine, std::vector<Warning>& warnings);

}  // namespace lamina::program
