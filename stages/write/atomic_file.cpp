#include "stages/write/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

namespace lamina::write {
namespace {

/// 0 or the system's error number.
int write_all(int file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    // Linux takes at most 0x7FFFF000 bytes at once and says so by writing less.
    const ssize_t written = ::write(file, bytes.data(), std::min<std::size_t>(bytes.size(), 0x7FFFF000));
    if (written < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    if (written == 0) return EIO;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

}  // namespace

Error write_failure(const std::string& path, int code) {
  switch (code) {
    case ENOSPC:
    case EDQUOT: return {Fault::kOutput, fmt::format("{}: disk full ({}); free some space", path, std::strerror(code))};
    case EFBIG:
      return {Fault::kOutput, fmt::format("{}: {}; raise the limit on file sizes (ulimit -f)", path, std::strerror(code))};
    default: return {Fault::kOutput, fmt::format("{}: cannot write: {}", path, std::strerror(code))};
  }
}

Status write_file(const std::string& asked, std::span<const std::byte> bytes) {
  std::string path = asked;
  struct stat status {};
  if (::lstat(asked.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
    if (S_ISLNK(status.st_mode)) {
      std::error_code error;
      path = std::filesystem::weakly_canonical(asked, error).string();
      if (error) return write_failure(asked, error.value());
    }
    if (::stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
      return Error{Fault::kOutput, fmt::format("{}: is {}, not a file; name another one", asked,
                                               S_ISDIR(status.st_mode) ? "a directory" : "a device or a pipe")};
    }
  }
  const std::string temporary = path + ".part";
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) return write_failure(path, errno);
  int code = write_all(file, bytes);
  // Network file systems report a full disk here. After EINTR the descriptor is gone all the same (Linux).
  if (::close(file) != 0 && code == 0 && errno != EINTR) code = errno;
  if (code == 0 && ::rename(temporary.c_str(), path.c_str()) != 0) code = errno;
  if (code != 0) {
    ::unlink(temporary.c_str());
    return write_failure(path, code);
  }
  return {};
}

}  // namespace lamina::write
