// pipeline/output/slice_directory.h: the files of a sliced job, and the removal of an earlier job's.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// ".svg", ".cli" or ".3mf"
std::string_view slice_extension(const Job& job);

/// Name of the single file: the first part's name with the format's extension.
std::string slice_file_name(const Job& job);

/// Refuses a directory with another job, or files that no record tells of, unless job.overwrite is set. errors  kUsage, kOutput
Status check_slice_output(const Job& job);

/// Temporary directory of per-layer files until all are written.
std::filesystem::path waiting_layers(const Job& job);

/// Makes the folder of waiting layers for a job that has them; of an earlier run it stays only if `keeps`. errors  kOutput
Status prepare_waiting_layers(const Job& job, bool keeps);

/// The files that an earlier job leaves to this one, its manifest last: what is left of a killed removal is on record. Without
/// job.overwrite, no layers that no record tells of.
std::vector<std::filesystem::path> earlier_slices(const Job& job);

/// Call when the job is complete: removes earlier files in their order, and renames the waiting layers. errors  kOutput
Status replace_slices(const Job& job, const std::vector<std::filesystem::path>& earlier);

/// Of a job that has failed; what cannot be removed is noted (stages/support/io/leftovers.h).
void remove_waiting_layers(const Job& job);

}  // namespace lamina::pipeline
