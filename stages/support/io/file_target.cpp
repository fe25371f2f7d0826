#include "stages/support/io/file_target.h"

#include <fmt/format.h>

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/temporary.h"

namespace lamina {
namespace {

constexpr int kMaxLinks = 40;  // as the kernel

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

/// named  by the caller; the names of a directory's own files cannot be chosen
Error not_a_file(const std::string& path, std::string_view what, bool named = true) {
  return {Fault::kOutput, fmt::format("{}: is {}, not a file; {}", path, what, named ? "name another one" : "remove it")};
}

constexpr std::size_t kMarkedHead = 4096;  // bytes of a file in which its mark stands

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

Result<FileTarget> find_target(const std::string& path, bool follow) {
  std::string name = path;
  for (int links = 0; links < kMaxLinks; ++links) {
    if (const int descriptor = descriptor_of(name); descriptor >= 0) return FileTarget{{}, name, descriptor};
    struct stat status {};
    if (::lstat(name.c_str(), &status) != 0) {
      if (errno == ENOENT) return FileTarget{name, {}, -1};
      return write_failure(path, errno);
    }
    if (S_ISREG(status.st_mode) || (S_ISLNK(status.st_mode) && !follow)) return FileTarget{name, {}, -1};
    if (S_ISDIR(status.st_mode)) return not_a_file(path, "a directory", follow);
    if (!S_ISLNK(status.st_mode) && !follow) return not_a_file(path, "a device or a pipe", false);
    if (!S_ISLNK(status.st_mode)) return FileTarget{{}, name, -1};
    // The kernel refuses links that others planted in a shared directory.
    if (::stat(name.c_str(), &status) != 0 && errno != ENOENT) return write_failure(path, errno);
    std::error_code error;
    const std::filesystem::path next = std::filesystem::read_symlink(name, error);
    if (error) return write_failure(path, error.value());
    name = (std::filesystem::path(name).parent_path() / next).string();
  }
  return write_failure(path, ELOOP);
}

Result<int> open_stream(const std::string& path, const FileTarget& target, bool allowed) {
  if (!allowed) return not_a_file(path, path == "-" ? "standard output" : "a device or a pipe");
  const int file = target.descriptor >= 0
                       ? ::fcntl(target.descriptor, F_DUPFD_CLOEXEC, 3)
                       : ::open(target.stream.c_str(), O_WRONLY | O_APPEND | O_NOCTTY | O_NOFOLLOW | O_CLOEXEC);
  if (file < 0) return write_failure(path, errno);
  return file;
}

std::optional<FileId> file_id(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return FileId{status.st_dev, status.st_ino};
}

bool same_file(const std::string& a, const std::string& b) {
  const std::optional<FileId> first = file_id(a);
  return first && first == file_id(b);
}

bool is_file(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
}

bool is_stream(const std::string& path) {
  struct stat status {};
  const bool there = ::stat(path.c_str(), &status) == 0;
  return path == "-" || (there && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode));
}

bool is_replaceable(const std::string& path, std::span<const std::string_view> marks) {
  if (!is_file(path)) return true;
  const auto file = FileReader::open(path, {});
  std::string head(file ? static_cast<std::size_t>(std::min<std::uint64_t>(kMarkedHead, file->size())) : 0, '\0');
  const bool read = file && file->read_at(0, head);
  const bool marked = std::ranges::any_of(marks, [&](std::string_view mark) {
    if (mark.empty()) return false;
    return mark.front() == '^' ? head.starts_with(mark.substr(1)) : head.find(mark) != std::string::npos;
  });
  return read && (marked || head.empty());
}

Status check_plain(const std::string& file, std::optional<std::uint64_t> bytes) {
  namespace fs = std::filesystem;
  const auto refuse = [&](const std::string& what) {
    return Error{Fault::kVerification, fmt::format("{}: {}; run its shard again with --resume", file, what)};
  };
  std::error_code error;
  const fs::file_status status = fs::symlink_status(file, error);
  if (!fs::is_regular_file(status)) return refuse(fs::exists(status) ? "is a link or a device, not a file" : "is missing");
  if (!bytes) return {};
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) return refuse("is missing");
  return size == *bytes ? Status() : Status(refuse(fmt::format("{} bytes, the manifest says {}", size, *bytes)));
}

Result<bool> bring_file(const std::string& from, const std::string& to) {
  namespace fs = std::filesystem;
  const std::string fresh = temporary_name(to);
  const int watched = watch(fresh.c_str());
  std::error_code error;
  fs::create_hard_link(from, fresh, error);
  const bool linked = !error;
  if (!linked) fs::copy_file(from, fresh, error);
  if (!error) fs::rename(fresh, to, error);
  remove_or_note(fresh);  // stays if `to` was a name of the same file already, and after an error
  forget(watched);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", to, error.message())};
  return linked;
}

}  // namespace lamina
