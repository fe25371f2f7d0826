// stages/program/care/care_check.h: whether a dialect can say the care that a profile asks for, and a machine can take it.
#pragma once

#include <string>

#include "stages/program/dialect.h"

namespace lamina::write {

/// Whether a dialect can say what a profile asks for beside drops and powder, and whether it can be done: places off the bed,
/// limits in seconds that the longest sweep keeps. errors  kUsage, with the key and what to do
Status check_care(const Dialect& dialect, const Machine& machine, const HeadGrid& grid);

/// Empty, or what a profile has places for and asks for never, and what of its care does not go together: a lamp that is
/// switched on and never off, a pause without a cap that is longer than nozzles may wait.
std::string idle_care(const Machine& machine);

}  // namespace lamina::write
