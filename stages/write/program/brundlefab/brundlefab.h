// stages/write/program/brundlefab/brundlefab.h: see the README here.
#pragma once

#include "stages/write/program/dialect.h"

namespace lamina::write::brundlefab {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::write::brundlefab
