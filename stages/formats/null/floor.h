// stages/formats/null/floor.h: the least time that any program would need for a job's files and rows, measured.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::formats {

/// What any program has to do for a job, on one thread: read the parts, write as many bytes in as many files under another name
/// and rename them, and touch each crossing of a row with a surface once, in memory that is in use already.
struct Floor {
  std::uint64_t bytes_read = 0, bytes_written = 0, files = 0, crossings = 0;
  double read = 0, write = 0, touch = 0;  // seconds
  double seconds() const { return read + write + touch; }
};

/// Fills in the seconds and the bytes read. It writes temporary files of `neighbour` (temporary.h), two at a time, that
/// are gone afterwards and at a signal; what a killed run leaves, the next one that writes `neighbour` removes.
/// Reading and writing count with the middle of three times, where once takes less than 0.1 s. At most 128 MiB of memory.
/// errors  kInput; kOutput: `neighbour` is a stream, or the system's reason; kInterrupted: `cancel` was set
Status measure_floor(const std::vector<std::string>& parts, const std::string& neighbour, const std::atomic<bool>& cancel,
                     Floor& floor);

}  // namespace lamina::formats
