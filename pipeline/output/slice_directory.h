// pipeline/output/slice_directory.h: the files of a sliced job, and the removal of an earlier job's.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "pipeline/job/job.h"
#include "stages/data/status.h"
#include "stages/write/temporary.h"

namespace lamina::pipeline {

/// ".svg", ".cli" or ".3mf"
std::string_view slice_extension(const Job& job);

/// Name of the single file: the first part's name with the format's extension.
std::string slice_file_name(const Job& job);

/// Refuses a directory with another job unless job.overwrite is set. errors  kUsage, kOutput
Status check_slice_output(const Job& job);

/// Temporary directory of per-layer files until all are written.
std::filesystem::path waiting_layers(const Job& job);

/// Call after check_slice_output: claims the directory and keeps existing files. errors  of claim_output, kOutput
Result<write::Claim> prepare_slice_directory(const Job& job);

/// Call when the job is complete: removes an earlier job's files and renames the waiting layers.
/// errors  kOutput
Status replace_earlier_slices(const Job& job);

/// Of a job that has failed; what cannot be removed is noted (stages/write/leftovers.h).
void remove_waiting_layers(const Job& job);

}  // namespace lamina::pipeline
