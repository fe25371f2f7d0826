// pipeline/output/slice_directory.h: the files of a sliced job, and what happens to those of an earlier one.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "pipeline/job/job.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// ".svg", ".cli" or ".3mf"
std::string_view slice_extension(const Job& job);

/// Of the one file: the first part's name with the format's ending.
std::string slice_file_name(const Job& job);

/// Refuses a directory that holds another job, unless job.overwrite. errors  kUsage, kOutput
Status check_slice_output(const Job& job);

/// Where layers in files of their own wait until all are written.
std::filesystem::path waiting_layers(const Job& job);

/// After check_slice_output: makes the directory. What an earlier job left stays. errors  of check_nobody_came, kOutput
Status prepare_slice_directory(const Job& job);

/// Called when the job is whole: what an earlier job left is removed, and layers that wait get their names.
/// errors  kOutput
Status replace_earlier_slices(const Job& job);

/// Removes, when it goes, layers that still wait: those of a job that failed.
class WaitingLayers {
 public:
  explicit WaitingLayers(const Job& job) : job_(job) {}
  WaitingLayers(const WaitingLayers&) = delete;
  ~WaitingLayers();

 private:
  const Job& job_;
};

}  // namespace lamina::pipeline
