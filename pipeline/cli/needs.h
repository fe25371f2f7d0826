// pipeline/cli/needs.h: options that have no effect unless another one is given.
#pragma once

#include <string>
#include <vector>

#include "pipeline/cli/terminal/arguments.h"
#include "pipeline/job/job.h"
#include "stages/data/choices.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

using pipeline::Arguments;

/// Refuses options that would do nothing in this job; keys of files are not looked at.
/// study   of layers alone: what decides none may still tell something about them
/// errors  kUsage with the option, why, and what to add
Status check_needs(Product product, const Arguments& arguments, const Job& job, bool study = false);
/// The same for options that the printer's files do not carry.
Status check_machine_needs(const Extruder& machine, const Arguments& arguments);
/// What options leave open, and those that do nothing but are harmless, a line each.
std::vector<std::string> notes_on_needs(Product product, const Arguments& arguments, const Job& job);

}  // namespace lamina::pipeline
