// pipeline/cli/plan_command.h: the commands that plan a job, jet, slice and extrude: one way through, three rows of data.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/job/product.h"

namespace lamina::pipeline {

/// What differs between the commands.
struct PlanCommand {
  Product product;
  KeyChoice keys;                         // of the job, as options
  std::string_view summary;               // what it does, for the help
  std::span<const OptionSpec> own;        // switches of the row: of --resume, --overwrite and --dry-run those that it has
  std::span<const OptionSpec> overrides;  // words for keys that mean something else here: value, meaning, preset if not ""
  std::string closing;                    // notes and examples
  bool divided = false;                   // its layers can be divided among machines (--shard)
  /// What the command line decides before the job is checked. errors  kUsage
  Status (*resolve)(const Arguments&, Job&);
};

CommandSpec plan_spec(const PlanCommand& row);

/// Reads the job, saves it if --save-job is there, plans it and tells the summary.
Outcome plan(const PlanCommand& row, const Arguments& arguments, Context& context);

}  // namespace lamina::pipeline
