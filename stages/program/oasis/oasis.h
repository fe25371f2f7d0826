// stages/program/oasis/oasis.h: see the README here.
#pragma once

#include "stages/program/dialect.h"

namespace lamina::program::oasis {

/// errors  kUsage: those of hp45, and two vats
Status check(const Machine& machine, const HeadGrid& grid);
std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::program::oasis
