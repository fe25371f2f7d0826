// stages/write/program/oasis/oasis.h: see the README here.
#pragma once

#include "stages/write/program/dialect.h"

namespace lamina::write::oasis {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::write::oasis
