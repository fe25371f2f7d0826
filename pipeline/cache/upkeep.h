// pipeline/cache/upkeep.h: the size of a cache, its damaged files, and its reduction to a size.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/cache/store.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct CacheSize {
  std::uint64_t entries = 0, objects = 0, bytes = 0;  // files with their sizes; blocks of the disk may be more
  std::uint64_t hits = 0, misses = 0;                 // since the cache was made
  std::int64_t oldest_use_s = 0, newest_use_s = 0;    // seconds since 1970, of entries; 0 without any
};
/// errors  kOutput: a folder cannot be read. cost  lists all files
Result<CacheSize> measure_cache(const JobCache& cache);

struct TrimmedCache {
  std::uint64_t entries = 0, objects = 0, bytes = 0;  // removed
};
/// Removes objects without an entry, then the entries that were used longest ago with what only they need, until the rest has
/// at most `max_bytes`. Objects of the last hour stay without an entry, too: a job may be adding them. now_s   seconds since
/// 1970 errors  kOutput; kInterrupted. cost  reads all entries
Result<TrimmedCache> trim_cache(JobCache& cache, std::uint64_t max_bytes, std::int64_t now_s, const std::atomic<bool>& cancel);

struct CheckedCache {
  std::uint64_t entries = 0, objects = 0, bytes = 0;  // read
  std::vector<std::string> damaged;                   // one line each; they are removed
};
/// Reads everything, and removes what is damaged: objects that differ from their names, entries, and entries without their
/// objects. errors  kOutput; kInterrupted
Result<CheckedCache> check_cache(JobCache& cache, const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
