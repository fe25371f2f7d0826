// pipeline/cli/keys.h: the keys of a job as options of a command, and the job that a command line asks for.
#pragma once

#include <initializer_list>
#include <string_view>
#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/job/job.h"
#include "pipeline/job/keys.h"

namespace lamina::pipeline {

/// Which keys of a job a command takes as options: whole sections ("bed"), or single keys ("run.threads"). Keys that
/// are not chosen can still be set by --job and --set, so that one job file serves all commands.
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

/// The job that a command line asks for: --job first, then operands as parts, then --set, then flags. Not checked yet:
/// see check_job(). errors  kUsage, one line that begins with the option or file
Result<Job> read_job_options(const KeyChoice& choice, const Arguments& arguments);

}  // namespace lamina::pipeline
