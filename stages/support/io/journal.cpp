#include "stages/support/io/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>
#include <utility>

#include "stages/data/shortage.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/sync.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestLine = 64 << 20;  // bytes

Error reason_of(const std::string& path, int code) {
  if (is_shortage(code)) return shortage(code, path);
  return {Fault::kOutput, fmt::format("{}: {}", path, std::strerror(code))};
}

/// Reads the lines. torn  set to whether the last one has no end
Status read_lines(const std::string& path, const ReadLine& line, bool& torn) {
  auto lines = FileReader::open(path, {.fault = Fault::kOutput, .longest_line = kLongestLine, .any_bytes = true});
  if (!lines) return lines.error();
  for (std::string_view text; lines->next(text);) {
    torn = !lines->ended_by_break();
    line(std::string(text), lines->offset() - text.size() - (torn ? 0 : 1));
  }
  return lines->status();
}

/// Tries again for a moment: is_journal_held() of another process has the lock briefly.
bool lock_journal(int file) {
  for (int attempt = 0; attempt < 20; ++attempt) {
    if (::flock(file, LOCK_EX | LOCK_NB) == 0) return true;
    if (errno != EWOULDBLOCK) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  errno = EWOULDBLOCK;
  return false;
}

}  // namespace

Status read_journal(const std::string& path, const ReadLine& line) {
  bool torn = false;
  return read_lines(path, line, torn);
}

bool is_journal_held(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (file < 0) return false;
  const bool held = ::flock(file, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(file);
  return held;
}

Result<Journal> Journal::open(const std::string& path, std::string_view held) {
  while (true) {
    const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
    if (file < 0) return reason_of(path, errno);
    Journal journal(path, file);
    struct stat status {
    }, named{};
    if (::fstat(file, &status) != 0) return reason_of(path, errno);
    if (!S_ISREG(status.st_mode)) return Error{Fault::kOutput, fmt::format("{}: is a device or a pipe, not a file", path)};
    if (!lock_journal(file)) {
      if (errno != EWOULDBLOCK) return reason_of(path, errno);
      return Error{Fault::kOutput, fmt::format("{}: {}", path, held)};
    }
    // Another process may have removed or replaced the file before this one had the lock.
    if (::lstat(path.c_str(), &named) == 0 && named.st_dev == status.st_dev && named.st_ino == status.st_ino) return journal;
  }
}

Journal::Journal(Journal&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      replaced_(std::exchange(other.replaced_, -1)),
      torn_(other.torn_) {}

Journal::~Journal() {
  for (const int file : {file_, replaced_}) {
    if (file >= 0) ::close(file);
  }
}

bool Journal::has_its_name() const {
  struct stat own {
  }, named{};
  return ::fstat(file_, &own) == 0 && ::stat(path_.c_str(), &named) == 0 && own.st_dev == named.st_dev &&
         own.st_ino == named.st_ino;
}

bool Journal::empty() const {
  std::error_code ignored;
  return std::filesystem::file_size(path_, ignored) == 0;
}

Status Journal::clear() {
  torn_ = false;
  return ::ftruncate(file_, 0) == 0 ? Status() : reason_of(path_, errno);
}

Status Journal::replace(std::string_view lines, const std::string& old) {
  const std::string fresh = path_ + ".part";
  ::unlink(fresh.c_str());  // of a killed process
  const int file = ::open(fresh.c_str(), O_RDWR | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0666);
  if (file < 0) return reason_of(fresh, errno);
  int reason = ::flock(file, LOCK_EX | LOCK_NB) != 0 ? errno : write_all(file, std::as_bytes(std::span(lines)));
  if (reason == 0) reason = sync_file(file);
  if (reason == 0 && (::unlink(old.c_str()) == 0 || errno == ENOENT)) (void)!::link(path_.c_str(), old.c_str());
  if (reason == 0 && ::rename(fresh.c_str(), path_.c_str()) != 0) reason = errno;
  if (reason != 0) {
    ::close(file);
    ::unlink(fresh.c_str());
    return reason_of(path_, reason);
  }
  sync_folder_of(path_);
  if (replaced_ >= 0) ::close(replaced_);
  replaced_ = std::exchange(file_, file);  // stays locked: another process may have opened it
  torn_ = false;
  return {};
}

Status Journal::read(const ReadLine& line) { return read_lines(path_, line, torn_); }

std::uint64_t Journal::end() const { return static_cast<std::uint64_t>(::lseek(file_, 0, SEEK_CUR)); }

Status Journal::append(std::string line) {
  if (torn_) line.insert(line.begin(), '\n');
  const int reason = write_all(file_, std::as_bytes(std::span(line)));
  torn_ = reason != 0;
  return torn_ ? Status(write_failure(path_, reason)) : Status();
}

Status Journal::sync() {
  const int reason = sync_file(file_);
  return reason == 0 ? Status() : Status(write_failure(path_, reason));
}

}  // namespace lamina
