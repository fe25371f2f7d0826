// pipeline/job/decisions.h: how often a process has decided what every job decides once; a test holds each run to once.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace lamina::pipeline {

/// The profile of the machine is found and read, what lies in the output is examined, the layers are decided, the filling
/// of a part is read.
enum class Decision { kMachine, kOutput, kHeights, kFilling };

inline std::atomic<std::uint64_t> decisions[4];

inline void count(Decision decision) { decisions[static_cast<std::size_t>(decision)].fetch_add(1, std::memory_order_relaxed); }
inline std::uint64_t times(Decision decision) { return decisions[static_cast<std::size_t>(decision)]; }

}  // namespace lamina::pipeline
