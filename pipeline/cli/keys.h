// pipeline/cli/keys.h: the keys of a job as options of a command, and the job given by a command line.
#pragma once

#include <initializer_list>
#include <string_view>
#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/job/job.h"
#include "pipeline/job/keys.h"

namespace lamina::pipeline {

/// The job keys that a command offers as options: whole sections ("bed") or single keys ("run.threads"). --job and --set
/// accept all other keys too, so one job file serves all commands.
class KeyChoice {
 public:
  KeyChoice(std::initializer_list<std::string_view> names) : names_(names) {}
  bool has(std::string_view section, std::string_view name) const;

 private:
  std::vector<std::string_view> names_;
};

/// Adds --job, --save-job and --set, then a flag for every chosen key and for every key of [[part]] (if "part" is
/// chosen), under the headings of the help.
void add_key_options(const KeyChoice& choice, CommandSpec& spec);

/// The job given by a command line: --job first, then operands as parts, then --set, then flags. Unchecked: see
/// check_job(). errors  kUsage, one line that begins with the option or file
Result<Job> read_job_options(const KeyChoice& choice, const Arguments& arguments);

}  // namespace lamina::pipeline
