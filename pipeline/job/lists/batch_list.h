// pipeline/job/lists/batch_list.h: the jobs of a batch from lists, directories and job files, not yet checked.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// One job as written in its source.
struct BatchEntry {
  std::string source;              // where: "jobs.txt:12", "parts/bracket.stl"
  std::string name;                // default name of the output; not unique yet
  std::vector<std::string> words;  // command and arguments: "jet", "bracket.stl", "--dpi", "600"
};

using IsPart = std::function<bool(std::string_view name)>;

/// The jobs of all operands, in order:
///   NAME.toml                         a job file: COMMAND --job NAME.toml, of the command in its first lines (job_command.h),
///   else
///                                     of jet
///   NAME.stl .obj .3mf (.gz)          a part: `with` and the file
///   a directory                       all of the above in it and below it, by name
///   anything else                     a list: one command line a line, "jet bracket.stl --dpi 600 -o bracket"; the word
///                                     lamina in front, empty lines and comments are skipped
/// is_part  whether a file of this name is a part
/// errors  kUsage: an operand that is missing, unreadable or without jobs; a line that cannot be split
Result<std::vector<BatchEntry>> read_batch(const std::vector<std::string>& operands, const std::vector<std::string>& with,
                                           const IsPart& is_part);

}  // namespace lamina::pipeline
