#include "stages/write/file_target.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "stages/write/file.h"

namespace lamina::write {
namespace {

constexpr int kMostLinks = 40;  // as the kernel
constexpr int kMostTries = 16;  // of two runs that begin in the same instant

/// The open descriptor that a name means, or -1.
int descriptor_of(std::string_view name) {
  if (name == "-" || name == "/dev/stdout") return STDOUT_FILENO;
  if (name == "/dev/stderr") return STDERR_FILENO;
  for (const std::string_view folder : {"/dev/fd/", "/proc/self/fd/"}) {
    if (!name.starts_with(folder)) continue;
    int descriptor = -1;
    const char* end = name.data() + name.size();
    const auto [stop, error] = std::from_chars(name.data() + folder.size(), end, descriptor);
    if (error == std::errc() && stop == end) return descriptor;
  }
  return -1;
}

Error busy(const std::string& path) {
  return {Fault::kOutput, fmt::format("{}: another run is writing here right now; wait for it or name another file", path)};
}

Error not_a_file(const std::string& path, std::string_view what) {
  return {Fault::kOutput, fmt::format("{}: is {}, not a file; name another one", path, what)};
}

Result<FileTarget> as_stream(const std::string& path, bool allowed, int descriptor) {
  if (descriptor < 0) return write_failure(path, errno);
  if (allowed) return FileTarget{{}, descriptor};
  ::close(descriptor);
  return not_a_file(path, path == "-" ? "standard output" : "a device or a pipe");
}

enum class Lock { kHeld, kTaken, kGone };

/// A lock holds only if the file still has its name. File systems without locks have one writer at a time by agreement.
Lock take_lock(int file, const std::string& name) {
  if (::flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) return Lock::kTaken;
  struct stat held {
  }, named{};
  const bool same = ::fstat(file, &held) == 0 && ::lstat(name.c_str(), &named) == 0 && held.st_dev == named.st_dev &&
                    held.st_ino == named.st_ino;
  return same ? Lock::kHeld : Lock::kGone;
}

/// errors  if what has the temporary file's name is no file: nothing is written through a link
Status check_is_file(const std::string& part) {
  struct stat status {};
  if (::lstat(part.c_str(), &status) != 0 || S_ISREG(status.st_mode)) return {};
  return Error{Fault::kOutput, fmt::format("{}: is {} where lamina writes its temporary file; remove it", part,
                                           S_ISLNK(status.st_mode) ? "a link" : "no file")};
}

/// Removes what a killed run left. Gone by now is as good.
Status remove_stale(const std::string& path, const std::string& part, bool lock) {
  if (Status status = check_is_file(part); !status) return status;
  int file = -1;
  if (lock) {
    file = ::open(part.c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
    if (file < 0) return errno == ENOENT ? Status() : Status(write_failure(part, errno));
    const Lock got = take_lock(file, part);
    if (got != Lock::kHeld) {
      ::close(file);
      return got == Lock::kTaken ? Status(busy(path)) : Status();
    }
  }
  const int reason = ::unlink(part.c_str()) != 0 && errno != ENOENT ? errno : 0;
  if (file >= 0) ::close(file);
  return reason == 0 ? Status() : Status(write_failure(part, reason));
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

int write_all(int file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    // Linux takes at most 0x7FFFF000 bytes at once and says so by writing less.
    const ssize_t written = ::write(file, bytes.data(), std::min<std::size_t>(bytes.size(), 0x7FFFF000));
    if (written > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    } else if (written == 0) {
      return EIO;
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      pollfd ready{file, POLLOUT, 0};
      ::poll(&ready, 1, -1);
    } else if (errno != EINTR) {
      return errno;
    }
  }
  return 0;
}

std::string part_of(const std::string& file) { return file + ".part"; }

Result<FileTarget> find_target(const std::string& path, bool stream) {
  std::string name = path;
  for (int links = 0; links < kMostLinks; ++links) {
    if (const int descriptor = descriptor_of(name); descriptor >= 0) {
      return as_stream(path, stream, ::fcntl(descriptor, F_DUPFD_CLOEXEC, 3));
    }
    struct stat status {};
    if (::lstat(name.c_str(), &status) != 0) {
      if (errno == ENOENT) return FileTarget{name};
      return write_failure(path, errno);
    }
    if (S_ISREG(status.st_mode)) return FileTarget{name};
    if (S_ISDIR(status.st_mode)) return not_a_file(path, "a directory");
    if (!S_ISLNK(status.st_mode)) {
      if (!stream) return not_a_file(path, "a device or a pipe");
      return as_stream(path, stream, ::open(name.c_str(), O_WRONLY | O_APPEND | O_NOCTTY | O_NOFOLLOW | O_CLOEXEC));
    }
    // The kernel refuses links that others planted in a shared directory.
    if (::stat(name.c_str(), &status) != 0 && errno != ENOENT) return write_failure(path, errno);
    std::error_code error;
    const std::filesystem::path next = std::filesystem::read_symlink(name, error);
    if (error) return write_failure(path, error.value());
    name = (std::filesystem::path(name).parent_path() / next).string();
  }
  return write_failure(path, ELOOP);
}

Result<int> create_part(const std::string& path, const std::string& part, bool lock) {
  for (int tries = 0; tries < kMostTries; ++tries) {
    const int file = ::open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (file < 0) {
      if (errno != EEXIST) return write_failure(path, errno);
      if (Status status = remove_stale(path, part, lock); !status) return status.error();
      continue;
    }
    const Lock got = lock ? take_lock(file, part) : Lock::kHeld;
    if (got == Lock::kHeld) return file;
    ::close(file);
    if (got == Lock::kTaken) break;
  }
  return busy(path);
}

Result<int> take_part(const std::string& path, const std::string& part, std::uint64_t size) {
  if (Status status = check_is_file(part); !status) return status.error();
  const int file = ::open(part.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return write_failure(part, errno);
  const Lock got = take_lock(file, part);
  struct stat status {};
  if (got == Lock::kHeld && ::fstat(file, &status) == 0 && static_cast<std::uint64_t>(status.st_size) >= size) return file;
  ::close(file);
  if (got != Lock::kHeld) return busy(path);
  return Error{Fault::kOutput,
               fmt::format("{}: is shorter than the {} bytes that its record names; start over with --overwrite", part, size)};
}

Status check_not_being_written(const std::string& path) {
  const std::string part = part_of(path);
  const int file = ::open(part.c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return {};
  const Lock got = take_lock(file, part);
  ::close(file);
  return got == Lock::kTaken ? Status(busy(path)) : Status();
}

}  // namespace lamina::write
