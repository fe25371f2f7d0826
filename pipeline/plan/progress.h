// pipeline/plan/progress.h: what a job tells while it runs.
#pragma once

#include <cstdint>
#include <functional>

namespace lamina::pipeline {

/// Told from time to time, from one thread at a time, while a job runs.
struct ProgressEvent {
  enum class Stage { kLoading, kIndexing, kLayers } stage;
  std::uint32_t done = 0, total = 0;  // layers
};
using ProgressCallback = std::function<void(const ProgressEvent&)>;

/// Most memory that the process has held at once, bytes.
std::uint64_t peak_resident_bytes();

}  // namespace lamina::pipeline
