// stages/load/source.cpp: open and pread.
#include "stages/load/source.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace lamina::load {

Source::Source(Source&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      memory_(std::move(other.memory_)),
      size_(std::exchange(other.size_, 0)) {}

Source& Source::operator=(Source&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(file_, other.file_);
  std::swap(memory_, other.memory_);
  std::swap(size_, other.size_);
  return *this;
}

Source::~Source() {
  if (file_ >= 0) ::close(file_);
}

Result<Source> Source::open(const std::string& path) {
  Source source;
  source.path_ = path;
  // Without O_NONBLOCK, opening a pipe that nobody writes to would wait for ever.
  source.file_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (source.file_ < 0) return source.error(std::string("cannot be opened: ") + std::strerror(errno));
  struct stat status {};
  if (::fstat(source.file_, &status) != 0) return source.error(std::string("cannot be opened: ") + std::strerror(errno));
  if (S_ISDIR(status.st_mode)) return source.error("is a directory; name a part file (STL, OBJ or 3MF)");
  if (!S_ISREG(status.st_mode)) return source.error("is not a regular file; write the part to a file first");
  source.size_ = static_cast<std::uint64_t>(status.st_size);
  return source;
}

Source Source::of_memory(std::string path, Buffer<char> bytes) {
  Source source;
  source.path_ = std::move(path);
  source.size_ = bytes.size();
  source.memory_ = std::move(bytes);
  return source;
}

bool Source::read(std::uint64_t offset, char* to, std::size_t count) const {
  if (offset > size_ || count > size_ - offset) return false;
  if (file_ < 0) {
    if (count > 0) std::memcpy(to, memory_.data() + offset, count);
    return true;
  }
  while (count > 0) {
    const ssize_t got = ::pread(file_, to, count, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    to += got;
    offset += static_cast<std::uint64_t>(got);
    count -= static_cast<std::size_t>(got);
  }
  return true;
}

std::string Source::head(std::size_t count) const {
  std::string bytes(static_cast<std::size_t>(std::min<std::uint64_t>(count, size_)), '\0');
  if (!read(0, bytes.data(), bytes.size())) bytes.clear();
  return bytes;
}

}  // namespace lamina::load
