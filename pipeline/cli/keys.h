// pipeline/cli/keys.h: the keys of a job as options of a command, the job given by a command line, and options that have no
// effect unless another one is given.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/job/job.h"
#include "pipeline/job/keys.h"
#include "stages/data/extruder.h"
#include "stages/data/machine.h"

namespace lamina::pipeline {

// choice  the job keys that a command offers as options: whole sections ("bed") or single keys ("run.threads"), with blanks
// between. --job and --set accept all other keys too, so one job file serves all commands.

/// Adds --job, --save-job and --set, then a flag for every chosen key and for every key of [[part]] (if "part" is
/// chosen), under the headings of the help.
void add_key_options(std::string_view choice, CommandSpec& spec);

/// The job given by a command line: --job first, then operands as parts, then --set, then flags. Unchecked: see
/// check_job(). errors  kUsage, one line that begins with the option or file
Result<Job> read_job_options(std::string_view choice, const Arguments& arguments);

/// Refuses options that would do nothing in this job; of keys of files, notes_on_needs() reports them.
/// study   of layers alone: an option without effect on the job may still affect the study
/// errors  kUsage with the option, why, and what to add
Status check_needs(Product product, const Arguments& arguments, const Job& job, bool study = false);
/// The same for options that the printer's powder or its files make meaningless.
Status check_machine_needs(const Machine& machine, const Arguments& arguments);
Status check_machine_needs(const Extruder& machine, const Arguments& arguments);
/// What options leave open, and those that do nothing but are harmless, a line each.
std::vector<std::string> notes_on_needs(Product product, const Arguments& arguments, const Job& job);

}  // namespace lamina::pipeline
