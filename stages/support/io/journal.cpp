#include "stages/support/io/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "stages/data/shortage.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestLine = 64 << 20;  // bytes

Error reason_of(const std::string& path, int code) {
  if (is_shortage(code)) return shortage(code, path);
  return {Fault::kOutput, fmt::format("{}: {}", path, std::strerror(code))};
}

}  // namespace

Result<Journal> Journal::open(const std::string& path, std::string_view held) {
  const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
  if (file < 0) return reason_of(path, errno);
  Journal journal(path, file);
  struct stat status {};
  if (::fstat(file, &status) != 0) return reason_of(path, errno);
  if (!S_ISREG(status.st_mode)) return Error{Fault::kOutput, fmt::format("{}: is a device or a pipe, not a file", path)};
  if (::flock(file, LOCK_EX | LOCK_NB) == 0) return journal;
  if (errno != EWOULDBLOCK) return reason_of(path, errno);
  return Error{Fault::kOutput, fmt::format("{}: {}", path, held)};
}

Journal::Journal(Journal&& other) noexcept
    : path_(std::move(other.path_)), file_(std::exchange(other.file_, -1)), torn_(other.torn_) {}

Journal::~Journal() {
  if (file_ >= 0) ::close(file_);
}

bool Journal::empty() const {
  std::error_code ignored;
  return std::filesystem::file_size(path_, ignored) == 0;
}

Status Journal::clear() {
  torn_ = false;
  return ::ftruncate(file_, 0) == 0 ? Status() : reason_of(path_, errno);
}

Status Journal::read(const std::function<void(const std::string&, std::uint64_t at)>& line) {
  auto lines = FileReader::open(path_, {.fault = Fault::kOutput, .longest_line = kLongestLine, .any_bytes = true});
  if (!lines) return lines.error();
  for (std::string_view text; lines->next(text);) {
    torn_ = !lines->ended_by_break();
    line(std::string(text), lines->offset() - text.size() - (torn_ ? 0 : 1));
  }
  return lines->status();
}

std::uint64_t Journal::end() const { return static_cast<std::uint64_t>(::lseek(file_, 0, SEEK_CUR)); }

Status Journal::append(std::string line) {
  if (torn_) line.insert(line.begin(), '\n');
  const int reason = write_all(file_, std::as_bytes(std::span(line)));
  torn_ = reason != 0;
  return torn_ ? Status(write_failure(path_, reason)) : Status();
}

}  // namespace lamina
