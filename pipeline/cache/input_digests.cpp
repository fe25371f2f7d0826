#include "pipeline/cache/input_digests.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstring>

#include "pipeline/job/errors.h"

namespace lamina::pipeline {
namespace {

/// Times of files advance in steps; two changes within one leave the same times.
constexpr std::int64_t kStepNs = 100'000'000;

std::int64_t ns_of(const timespec& time) { return time.tv_sec * 1'000'000'000 + time.tv_nsec; }

bool equal_times(const timespec& a, const timespec& b) { return ns_of(a) == ns_of(b); }

}  // namespace

Result<FileDigest> InputDigests::of(const std::string& path) {
  struct stat now {};
  if (::stat(path.c_str(), &now) != 0) return failure(Fault::kInput, "{}: {}", path, std::strerror(errno));
  if (!S_ISREG(now.st_mode)) return failure(Fault::kInput, "{}: is not a regular file", path);
  {
    const std::lock_guard lock(mutex_);
    const auto found = known_.find(path);
    if (found != known_.end()) {
      const Known& known = found->second;
      if (known.settled && known.device == now.st_dev && known.inode == now.st_ino &&
          known.digest.bytes == static_cast<std::uint64_t>(now.st_size) && equal_times(known.modified, now.st_mtim) &&
          equal_times(known.changed, now.st_ctim))
        return known.digest;
    }
  }
  timespec clock{};
  ::clock_gettime(CLOCK_REALTIME, &clock);
  const Result<FileDigest> digest = digest_file(path);
  if (!digest) return failure(Fault::kInput, "{}", digest.error().message);
  const std::lock_guard lock(mutex_);
  known_[path] = {now.st_dev, now.st_ino, now.st_mtim, now.st_ctim, ns_of(clock) - ns_of(now.st_ctim) > kStepNs, *digest};
  return digest;
}

}  // namespace lamina::pipeline
