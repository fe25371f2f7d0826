// pipeline/job/decisions.h: counts decisions that a job makes once; a test checks that each run makes them once.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace lamina::pipeline {

/// In order: finding and reading the machine's profile, examining the output, deciding the layers, reading a part's
/// filling.
enum class Decision { kMachine, kOutput, kHeights, kFilling };

inline std::atomic<std::uint64_t> decisions[4];

inline void count(Decision decision) { decisions[static_cast<std::size_t>(decision)].fetch_add(1, std::memory_order_relaxed); }
inline std::uint64_t times(Decision decision) { return decisions[static_cast<std::size_t>(decision)]; }

}  // namespace lamina::pipeline
