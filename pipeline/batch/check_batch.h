// pipeline/batch/check_batch.h: compares the outputs of a batch with its records.
#pragma once

#include <cstdint>
#include <string>

#include "pipeline/check/verify.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Faults name the line of the list, then the output.
struct BatchCheck : Faults {
  std::uint64_t jobs = 0, failed = 0;  // that ended; failed ones have no output to compare
  std::uint64_t files = 0, bytes = 0;  // of the others, as recorded
};

/// Every job of the records: its output exists and has the recorded digest, and a job directory or toolpaths with a manifest
/// are verified (pipeline/check/verify.h). Jobs that are missing or running are faults.
/// errors  of read_batch_directory()
/// cost    reads every output once for its digest, and as often as verify() does
Result<BatchCheck> check_batch(const std::string& directory, const VerifyOptions& options);

}  // namespace lamina::pipeline
