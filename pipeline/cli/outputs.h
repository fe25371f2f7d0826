// pipeline/cli/outputs.h: checks a call's outputs against its inputs and existing files, before loading.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/cli/terminal/arguments.h"
#include "pipeline/job/job.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// An input file of a call, with its role: "the job file".
struct InputFile {
  std::string path, role;
};

/// Refuses outputs that are inputs under any name or link: files are compared by device and inode. An output directory
/// includes the contents of its layers/ and program/.
/// errors  kUsage
Status check_outputs(std::span<const InputFile> inputs, std::span<const std::string> outputs);

/// The same for every file in a command's arguments. A study, picture, page or saved job replaces a file only if lamina
/// wrote that file as the same kind, or with --overwrite.
/// errors  kUsage; kOutput for a device or a pipe in place of a file
Status check_outputs(std::string_view command, const Arguments& arguments);

/// The same for the files named in a job, by a job file or --set.
Status check_outputs(const Arguments& arguments, const Job& job);

/// Checks the folder of a file before the work, not after it; "" and "-" have none. errors  kOutput
Status check_folder(std::string_view flag, const std::string& file);

/// Allows a file to be replaced if it is absent, empty or carries one of lamina's marks. errors  kUsage
Status check_own_file(const std::string& path, std::span<const std::string_view> marks);

/// Refuses a table in the place of a job's own files. errors  kUsage
Status check_quote(const Arguments& arguments, const std::string& directory);

/// Writes the table that --quote requests. errors  kInput: there is none, as layers of an earlier build have no times
Status write_quote(const Arguments& arguments, const std::vector<std::vector<std::string>>& rows);

/// Whether an option's value is an input file; whether it is an output file.
bool is_input_option(std::string_view flag);
bool is_output_option(std::string_view flag);

}  // namespace lamina::pipeline
