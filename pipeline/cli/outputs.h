// pipeline/cli/outputs.h: what a call writes against what it reads and what is there, before anything is loaded.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "pipeline/cli/arguments.h"
#include "pipeline/job/job.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// A file that a call reads, and as what: "the job file".
struct InputFile {
  std::string path, role;
};

/// Refuses outputs that are inputs, under whatever names and links: files are compared by device and inode. Of an output
/// that is a directory, what lies in its layers/ and program/ counts as written.
/// errors  kUsage
Status check_outputs(std::span<const InputFile> inputs, std::span<const std::string> outputs);

/// The same for all that the arguments of a command name. A study, a picture, a page or a saved job replaces a file only
/// if lamina wrote it as one, or with --overwrite.
/// errors  kUsage; kOutput for a device or a pipe where a file is written
Status check_outputs(std::string_view command, const Arguments& arguments);

/// The same for the files that a job names, in a job file or by --set.
Status check_outputs(const Arguments& arguments, const Job& job);

/// Whether a file of that name may be replaced: it is absent, empty or begins as lamina's own. errors  kUsage
Status check_own_file(const std::string& path, std::span<const std::string_view> marks);

/// Whether the value of an option is a file that is read, or one that is written.
bool is_input_option(std::string_view flag);
bool is_output_option(std::string_view flag);

}  // namespace lamina::pipeline
