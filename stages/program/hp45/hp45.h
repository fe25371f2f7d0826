// stages/program/hp45/hp45.h: see the README here.
#pragma once

#include "stages/program/dialect.h"

namespace lamina::write::hp45 {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::write::hp45
