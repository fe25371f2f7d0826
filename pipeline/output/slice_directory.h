// pipeline/output/slice_directory.h: the files of a sliced job, and the removal of an earlier job's.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "pipeline/job/job.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// ".svg", ".cli" or ".3mf"
std::string_view slice_extension(const Job& job);

/// Name of the single file: the first part's name with the format's extension.
std::string slice_file_name(const Job& job);

/// Refuses a directory with another job unless job.overwrite is set. errors  kUsage, kOutput
Status check_slice_output(const Job& job);

/// Temporary directory of per-layer files until all are written.
std::filesystem::path waiting_layers(const Job& job);

/// Call after check_slice_output: creates the directory and keeps existing files. errors  of check_nobody_came, kOutput
Status prepare_slice_directory(const Job& job);

/// Call when the job is complete: removes an earlier job's files and renames the waiting layers.
/// errors  kOutput
Status replace_earlier_slices(const Job& job);

/// Removes the waiting layers of a failed job on destruction.
class WaitingLayers {
 public:
  explicit WaitingLayers(const Job& job) : job_(job) {}
  WaitingLayers(const WaitingLayers&) = delete;
  ~WaitingLayers();

 private:
  const Job& job_;
};

}  // namespace lamina::pipeline
