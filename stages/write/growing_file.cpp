#include "stages/write/growing_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "stages/write/atomic_file.h"

namespace lamina::write {

Result<GrowingFile> GrowingFile::open(const std::string& path) {
  const int file = ::open((path + ".part").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) return write_failure(path, errno);
  return GrowingFile(path, file);
}

GrowingFile::GrowingFile(GrowingFile&& other) noexcept
    : path_(std::move(other.path_)), file_(std::exchange(other.file_, -1)), size_(other.size_) {}

GrowingFile::~GrowingFile() {
  if (file_ < 0) return;
  ::close(file_);
  ::unlink((path_ + ".part").c_str());
}

Status GrowingFile::append(std::span<const char> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_, bytes.data(), std::min<std::size_t>(bytes.size(), 0x7FFFF000));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return write_failure(path_, written < 0 ? errno : EIO);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    size_ += static_cast<std::uint64_t>(written);
  }
  return {};
}

Status GrowingFile::finish() {
  const int file = std::exchange(file_, -1);
  int code = ::close(file) != 0 && errno != EINTR ? errno : 0;
  const std::string part = path_ + ".part";
  if (code == 0 && std::rename(part.c_str(), path_.c_str()) != 0) code = errno;
  if (code == 0) return {};
  ::unlink(part.c_str());
  return write_failure(path_, code);
}

}  // namespace lamina::write
