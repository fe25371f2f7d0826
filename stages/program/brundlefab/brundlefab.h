// stages/program/brundlefab/brundlefab.h: see the README here.
#pragma once

#include "stages/program/dialect.h"

namespace lamina::program::brundlefab {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

/// What the firmware can move and fire. errors  kUsage: another dot than that of the ink bar, other axes, a bed beside
/// what the bar, the carriage and the bins reach, a second feed bin, more than a dot a millisecond
Status check(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::program::brundlefab
