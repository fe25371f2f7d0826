#include "pipeline/cache/input_digests.h"

#include <cerrno>
#include <cstring>

#include "pipeline/job/errors.h"

namespace lamina::pipeline {

Result<FileDigest> InputDigests::of(const std::string& path) {
  const std::optional<FileStamp> now = file_stamp(path);
  if (!now) return failure(Fault::kInput, "{}: {}", path, errno != 0 ? std::strerror(errno) : "is not a regular file");
  {
    const std::lock_guard lock(mutex_);
    const auto found = known_.find(path);
    if (found != known_.end() && found->second.stamp.settled && found->second.stamp == *now) return found->second.digest;
  }
  const Result<FileDigest> digest = digest_file(path);
  if (!digest) return failure(Fault::kInput, "{}", digest.error().message);
  const std::lock_guard lock(mutex_);
  known_[path] = {*now, *digest};
  return digest;
}

}  // namespace lamina::pipeline
