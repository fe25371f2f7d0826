// stages/program/nuferbj/nuferbj.h: G-code of a binder jet with two vats and a tilted head; see the README here.
#pragma once

#include "stages/program/dialect.h"

namespace lamina::program::nuferbj {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::program::nuferbj
