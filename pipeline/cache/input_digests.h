// pipeline/cache/input_digests.h: hashes of input files, each taken once as long as the file does not change.
#pragma once

#include <map>
#include <mutex>
#include <string>

#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/file.h"

namespace lamina::pipeline {

/// Any thread may call it. A file counts as unchanged if it is the same inode with the same size and times.
class InputDigests {
 public:
  /// errors  kInput: no regular file, or it cannot be read
  /// cost    a system call for a known file, else reads it once
  Result<FileDigest> of(const std::string& path);

 private:
  struct Known {
    FileStamp stamp;  // before it was hashed
    FileDigest digest;
  };
  std::mutex mutex_;
  std::map<std::string, Known> known_;
};

}  // namespace lamina::pipeline
