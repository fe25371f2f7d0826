// stages/program/raw/raw.h: see the README here.
#pragma once

#include "stages/program/dialect.h"

namespace lamina::program::raw {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::program::raw
