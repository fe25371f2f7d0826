// stages/program/m578/m578.h: see the README here.
#pragma once

#include "stages/program/dialect.h"

namespace lamina::program::m578 {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

/// errors  kUsage: a version of the firmware that has no M578
Status check(const Machine& machine, const HeadGrid& grid);

/// MaintenanceRules: shots of one nozzle after the other, and a sweep that stops at each step and fires all.
double shot_s(const Machine& machine);
double longest_sweep_s(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::program::m578
