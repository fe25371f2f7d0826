// stages/program/planes/planes.h: see the README here.
#pragma once

#include "stages/program/dialect.h"

namespace lamina::program::planes {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::program::planes
