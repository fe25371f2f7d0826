// pipeline/plan/progress.h: progress of a running job.
#pragma once

#include <cstdint>
#include <functional>

namespace lamina::pipeline {

/// Reported at intervals while a job runs, from one thread at a time.
struct ProgressEvent {
  enum class Stage { kLoading, kIndexing, kLayers, kBuilds, kJobs } stage;
  std::uint32_t done = 0, total = 0;  // layers, builds or jobs
};
using ProgressCallback = std::function<void(const ProgressEvent&)>;

/// Peak memory of the process since it began, bytes, by the kernel's count, which errs by some hundred kilobytes.
std::uint64_t peak_resident_bytes();

}  // namespace lamina::pipeline
