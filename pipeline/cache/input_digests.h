// pipeline/cache/input_digests.h: hashes of input files, each taken once as long as the file does not change.
#pragma once

#include <cstdint>
#include <ctime>
#include <map>
#include <mutex>
#include <string>

#include "stages/data/status.h"
#include "stages/support/hash/hash.h"

namespace lamina::pipeline {

/// Any thread may call it. A file counts as unchanged if it is the same inode with the same size and times.
class InputDigests {
 public:
  /// errors  kInput: no regular file, or it cannot be read
  /// cost    a system call for a known file, else reads it once
  Result<FileDigest> of(const std::string& path);

 private:
  struct Known {
    std::uint64_t device = 0, inode = 0;
    timespec modified{}, changed{};
    bool settled = false;  // the file was older than the resolution of its times when it was hashed
    FileDigest digest;
  };
  std::mutex mutex_;
  std::map<std::string, Known> known_;
};

}  // namespace lamina::pipeline
