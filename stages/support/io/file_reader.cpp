#include "stages/support/io/file_reader.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "stages/data/shortage.h"
#include "stages/support/io/container.h"
#include "stages/support/io/paged.h"

namespace lamina {
namespace {

constexpr std::size_t kPiece = 64 << 10, kLongestPiece = 16 << 20;  // bytes read at once

/// A size for a person: whole MiB and KiB where it is.
std::string size_text(std::uint64_t bytes) {
  if (bytes % (1 << 20) == 0) return fmt::format("{} MiB", bytes >> 20);
  return bytes % (1 << 10) == 0 ? fmt::format("{} KiB", bytes >> 10) : fmt::format("{} bytes", bytes);
}

std::string too_long(std::uint64_t maximum) {
  return fmt::format("holds more than {}, the most for such a file", size_text(maximum));
}

/// Empty, or why a file of this kind is not read.
std::string fault_of_kind(const struct stat& status, bool stream, const ReadRules& rules) {
  if (S_ISDIR(status.st_mode)) return std::string(rules.directory);
  if (S_ISREG(status.st_mode)) {
    return static_cast<std::uint64_t>(status.st_size) > rules.max_bytes ? too_long(rules.max_bytes) : std::string();
  }
  if (stream) return {};
  return std::string(rules.device) + (rules.streams ? "; give what it holds to standard input and name it -" : "");
}

/// The first LF, or with cr the first CR or LF; null without one. cost  linear also in files that have only one of the two
const char* find_end(const char* from, std::size_t size, bool cr) {
  const std::size_t step = cr ? 256 : size;
  for (; size > 0; from += std::min(step, size), size -= std::min(step, size)) {
    const void* lf = std::memchr(from, '\n', std::min(step, size));
    const std::size_t before =
        lf != nullptr ? static_cast<std::size_t>(static_cast<const char*>(lf) - from) : std::min(step, size);
    const void* end = cr ? std::memchr(from, '\r', before) : nullptr;
    if (end != nullptr || lf != nullptr) return static_cast<const char*>(end != nullptr ? end : lf);
  }
  return nullptr;
}

}  // namespace

struct FileReader::State {
  std::string path;
  ReadRules rules;
  int file = -1;
  bool entry = false;  // of a container: [base, base + size) of the file
  std::uint64_t base = 0;
  int copy = -1;        // of an entry, once its descriptor is wanted
  bool own = true;      // the descriptor is closed in the end
  bool stream = false;  // may wait for bytes
  std::uint64_t size = 0;
  std::string buffer;
  std::size_t begin = 0, end = 0;  // unread part of buffer
  std::uint64_t line = 0, offset = 0, taken = 0;
  bool at_end = false, ended_by_break = true, ended_by_cr = false;
  Status status;

  ~State() {
    if (file >= 0 && own) ::close(file);
    if (copy >= 0) ::close(copy);
  }
  /// As ::read().
  ssize_t get(std::span<char> to) const {
    if (!entry) return ::read(file, to.data(), to.size());
    const std::uint64_t left = size - std::min(size, taken);
    return ::pread(file, to.data(), static_cast<std::size_t>(std::min<std::uint64_t>(left, to.size())),
                   static_cast<off_t>(base + taken));
  }
  Error error(const std::string& what) const { return {rules.fault, fmt::format("{}: {}", path, what)}; }
  bool stop(const std::string& what) {
    status = Error{rules.fault, fmt::format("{}:{}: {}", path, line + 1, what)};
    return false;
  }

  /// Reads up to `most` bytes behind `end`; false at the end of the file and after an error.
  bool fill(std::size_t maximum) {
    if (at_end || !status) return false;
    if (begin > 0) {
      std::memmove(buffer.data(), buffer.data() + begin, end - begin);
      end -= std::exchange(begin, 0);
    }
    if (buffer.size() < end + maximum) buffer.resize(std::max(end + maximum, buffer.size() + buffer.size() / 2));
    pollfd waiting{file, POLLIN, 0};
    if (stream && ::poll(&waiting, 1, -1) < 0 && errno == EINTR) {  // unlike read(), it is never taken up again
      status = Error{Fault::kInterrupted, fmt::format("{}: interrupted", path)};
      return false;
    }
    ssize_t got = 0;
    do {
      got = get(std::span(buffer).subspan(end, maximum));
    } while (got < 0 && errno == EINTR);
    if (got < 0) {
      status = error(fmt::format("cannot be read: {}", std::strerror(errno)));
      return false;
    }
    at_end = got == 0;
    end += static_cast<std::size_t>(got);
    taken += static_cast<std::uint64_t>(got);
    if (taken > rules.max_bytes) {
      status = error(too_long(rules.max_bytes));
      return false;
    }
    return !at_end;
  }
};

FileReader::FileReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
FileReader::FileReader(FileReader&&) noexcept = default;
FileReader& FileReader::operator=(FileReader&&) noexcept = default;
FileReader::~FileReader() = default;

bool names_stream(std::string_view path) {
  return path == "-" || path == "/dev/stdin" || path.starts_with("/dev/fd/") || path.starts_with("/proc/self/fd/");
}

Result<FileReader> FileReader::open(const std::string& path, const ReadRules& rules) {
  auto state = std::make_unique<State>();
  state->path = path;
  state->rules = rules;
  const bool stream = rules.streams && names_stream(path);
  if (stream && path == "-") {
    state->file = STDIN_FILENO;
    state->own = false;
  } else {
    // Without O_NONBLOCK, opening a pipe without a writer would wait for ever.
    state->file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
  }
  if (state->file < 0 && (errno == ENOTDIR || (errno == ENOENT && is_page_name(path)))) {
    const OpenedEntry found = open_entry(path);
    if (!found.fault.empty()) return state->error(found.fault);
    state->file = found.file;
    state->entry = found.file >= 0;
    state->base = found.offset;
    state->size = found.bytes;
  }
  struct stat status {};
  if (state->file < 0 || ::fstat(state->file, &status) != 0) {
    if (is_shortage(errno)) return shortage(errno, path);
    const bool absent = errno == ENOENT || errno == ENOTDIR;
    return state->error(absent ? std::string(rules.missing) : fmt::format("cannot be opened: {}", std::strerror(errno)));
  }
  if (state->entry) status.st_size = static_cast<off_t>(state->size);
  if (const std::string fault = fault_of_kind(status, stream, rules); !fault.empty()) return state->error(fault);
  if (stream && state->own) ::fcntl(state->file, F_SETFL, ::fcntl(state->file, F_GETFL) & ~O_NONBLOCK);
  state->stream = !S_ISREG(status.st_mode);
  if (!state->stream) state->size = static_cast<std::uint64_t>(status.st_size);
  return FileReader(std::move(state));
}

const std::string& FileReader::path() const { return state_->path; }
std::uint64_t FileReader::size() const { return state_->size; }
int FileReader::descriptor() const {
  State& state = *state_;
  if (!state.entry) return state.file;
  if (state.copy < 0) state.copy = copy_range(state.file, state.base, state.size);
  return state.copy;
}
const Status& FileReader::status() const { return state_->status; }
std::uint64_t FileReader::line_number() const { return state_->line; }
std::uint64_t FileReader::offset() const { return state_->offset; }
bool FileReader::ended_by_break() const { return state_->ended_by_break; }
bool FileReader::ended_by_cr() const { return state_->ended_by_cr; }

Result<std::string> FileReader::text() {
  State& state = *state_;
  std::uint64_t left = state.size;
  do {
    left = state.size - std::min(state.size, state.taken);
  } while (state.fill(static_cast<std::size_t>(std::clamp<std::uint64_t>(left, 1024, kLongestPiece))));
  if (!state.status) return state.status.error();
  std::string all = std::move(state.buffer);
  all.resize(state.end);
  all.erase(0, std::exchange(state.begin, state.end = 0));
  return all;
}

bool FileReader::next(std::string_view& line) {
  State& state = *state_;
  if (!state.status) return false;
  std::size_t searched = 0;  // bytes of the unread part that hold no end of a line
  const auto has_nul = [&](std::size_t from, std::size_t to) {
    return std::memchr(state.buffer.data() + from, '\0', to - from) != nullptr;
  };
  while (true) {
    const char* from = state.buffer.data() + state.begin;
    const std::size_t held = state.end - state.begin;
    const char* found = held > searched ? find_end(from + searched, held - searched, state.rules.cr_ends) : nullptr;
    const std::size_t length = found != nullptr ? static_cast<std::size_t>(found - from) : held;
    const bool cr = found != nullptr && *found == '\r';
    if (!state.rules.any_bytes && has_nul(state.begin + searched, state.begin + length))
      return state.stop(std::string(state.rules.no_text));
    if (length > state.rules.longest_line) {
      return state.stop(fmt::format("a line of more than {}; {}", size_text(state.rules.longest_line), state.rules.no_text));
    }
    searched = length;
    const bool may_go_on = found == nullptr || (cr && length + 1 == held);  // a LF may follow
    if (may_go_on && state.fill(kPiece)) continue;
    if (!state.status || (found == nullptr && held == 0)) return false;
    line = {state.buffer.data() + state.begin, length};
    state.ended_by_break = found != nullptr;
    const bool pair = cr && length + 1 < held && line.data()[length + 1] == '\n';
    state.ended_by_cr = cr && !pair;
    const std::size_t step = length + (state.ended_by_break ? 1 : 0) + (pair ? 1 : 0);
    state.begin += step;
    state.offset += step;
    ++state.line;
    return true;
  }
}

void FileReader::bound_lines(std::size_t longest) { state_->rules.longest_line = longest; }

void FileReader::go_to(std::uint64_t offset, std::uint64_t lines) {
  State& state = *state_;
  state.offset = state.taken = offset;
  state.line = lines;
  state.status = {};
  state.begin = state.end = 0;
  state.at_end = !state.entry && ::lseek(state.file, static_cast<off_t>(offset), SEEK_SET) < 0;
}

Result<std::size_t> FileReader::read(std::span<char> to) {
  State& state = *state_;
  ssize_t got = 0;
  do {
    got = state.get(to);
  } while (got < 0 && errno == EINTR);
  if (got < 0) return state.error(std::strerror(errno));
  state.taken += static_cast<std::uint64_t>(got);
  return static_cast<std::size_t>(got);
}

bool FileReader::read_at(std::uint64_t offset, std::span<char> to) const {
  if (state_->entry && (offset > state_->size || to.size() > state_->size - offset)) return false;
  offset += state_->base;
  while (!to.empty()) {
    const ssize_t got = ::pread(state_->file, to.data(), to.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    to = to.subspan(static_cast<std::size_t>(got));
    offset += static_cast<std::uint64_t>(got);
  }
  return true;
}

Result<std::string> read_file(const std::string& path, const ReadRules& rules) {
  auto file = FileReader::open(path, rules);
  if (!file) return file.error();
  return file->text();
}

}  // namespace lamina
