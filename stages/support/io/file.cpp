#include "stages/support/io/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "stages/data/shortage.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/paged.h"
#include "stages/support/io/rename.h"
#include "stages/support/io/sync.h"
#include "stages/support/io/temporary.h"

namespace lamina {
namespace {

constexpr std::size_t kGathered = 64 << 10, kLarge = 16 << 10;  // bytes that wait for one system call; pieces that do not
constexpr std::uint64_t kGiven = 2 << 20;                       // bytes with which the disk begins while the file grows
constexpr int kMaxLinks = 40;                                   // as the kernel

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

struct File::State {
  std::string path;    // as named, for errors
  std::string target;  // the file that it leads to
  std::string grows;   // the name until then; "" for a stream
  int watched = -1;    // removed at a signal
  FileOptions options;
  bool streams = false;
  int file = -1;
  std::uint64_t size = 0;
  std::uint64_t waiting = 0;  // bytes that the disk has not been given
  Buffer<std::byte> gathered;
  std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> hash{nullptr, XXH3_freeState};

  State(const std::string& name, const FileOptions& chosen) : path(name), options(chosen) {
    if (!options.hash) return;
    hash.reset(XXH3_createState());
    XXH3_128bits_reset(hash.get());
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    if (file < 0) return;
    if (options.keep_part || streams) {
      write_all(file, gathered);  // an error is found by the next caller
    } else {
      remove();
    }
    ::close(file);
  }

  void grow(std::string name) {
    grows = std::move(name);
    if (!options.keep_part) watched = watch(grows.c_str());
  }
  /// Under the lock: another run may not find the name of a file that is being removed.
  void remove() {
    forget(std::exchange(watched, -1));
    remove_or_note(grows);
  }

  Status put(std::span<const std::byte> bytes) {
    const int reason = write_all(file, bytes);
    if (reason != 0) return write_failure(path, reason);
    give(bytes.size());
    return {};
  }

  /// Lets the disk begin with what is written, so that the sync at the end waits for less. It reports the errors, too.
  void give(std::size_t bytes) {
    waiting += bytes;
    if (waiting < kGiven || streams || options.durable == Durable::kNo) return;
    waiting = 0;
    ::sync_file_range(file, 0, 0, SYNC_FILE_RANGE_WRITE);
  }

  /// Takes the bytes that the file has already into the hash.
  int hash_what_is_there() {
    Buffer<std::byte> piece(256 << 10);
    for (std::uint64_t at = 0; at < size;) {
      const auto maximum = static_cast<std::size_t>(std::min<std::uint64_t>(piece.size(), size - at));
      const ssize_t got = ::pread(file, piece.data(), maximum, static_cast<off_t>(at));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return got < 0 ? errno : EIO;
      XXH3_128bits_update(hash.get(), piece.data(), static_cast<std::size_t>(got));
      at += static_cast<std::uint64_t>(got);
    }
    return 0;
  }

  int rename_to_target() const {
    if (options.replace) return std::rename(grows.c_str(), target.c_str()) == 0 ? 0 : errno;
    return rename_new(grows, target);
  }

  /// Network file systems report a full disk when a descriptor is closed: that of a locked file is closed twice, once
  /// before the file has its name, once, with its lock, behind. After EINTR a descriptor is closed all the same (Linux).
  int close_and_rename() {
    int reason = options.durable == Durable::kNo ? 0 : sync_file(file);
    const bool held = options.lock;
    const int first = held ? ::fcntl(file, F_DUPFD_CLOEXEC, 3) : std::exchange(file, -1);
    if (first < 0) return errno;
    if (::close(first) != 0 && errno != EINTR && reason == 0) reason = errno;
    if (reason == 0) reason = rename_to_target();
    if (reason == 0) {
      forget(std::exchange(watched, -1));
    } else if (!options.keep_part) {
      remove();
    }
    if (held) ::close(std::exchange(file, -1));
    return reason == 0 && options.durable == Durable::kAll ? sync_folder_of(target) : reason;
  }
};

File::File(std::unique_ptr<State> state) : state_(std::move(state)) {}
File::File(File&&) noexcept = default;
File& File::operator=(File&&) noexcept = default;
File::~File() = default;

Result<File> File::open(const std::string& path, const FileOptions& options) {
  auto state = std::make_unique<State>(path, options);
  const auto target = find_target(path, options.follow);
  if (!target) return target.error();
  state->target = target->file;
  state->streams = target->file.empty();
  if (state->streams) {
    const auto stream = open_stream(path, *target, options.stream);
    if (!stream) return stream.error();
    state->file = *stream;
  } else if (options.keep_part) {
    const auto part = create_part(path, part_of(target->file));
    if (!part) return part.error();
    state->file = *part;
    state->options.lock = true;
    state->grow(part_of(target->file));
  } else {
    auto made = create_temporary(path, target->file, options.lock);
    if (!made) return made.error();
    state->file = made->file;
    state->grow(std::move(made->name));
  }
  return File(std::move(state));
}

Result<File> File::reopen(const std::string& path, std::uint64_t size, const FileOptions& options) {
  auto state = std::make_unique<State>(path, options);
  const auto target = find_target(path, options.follow);
  if (!target) return target.error();
  if (target->file.empty()) return open_stream(path, *target, false).error();
  state->target = target->file;
  state->grows = part_of(target->file);
  const auto part = take_part(path, state->grows, size);
  if (!part) return part.error();
  // A file that cannot be continued stays as it is.
  const bool keep = std::exchange(state->options.keep_part, true);
  state->file = *part;
  state->size = size;
  int reason = options.hash ? state->hash_what_is_there() : 0;
  if (reason == 0 && ::ftruncate(state->file, static_cast<off_t>(size)) != 0) reason = errno;
  if (reason == 0 && ::lseek(state->file, 0, SEEK_END) < 0) reason = errno;
  if (reason != 0) return write_failure(path, reason);
  state->options.keep_part = keep;
  state->options.lock = true;
  state->grow(state->grows);
  return File(std::move(state));
}

Status File::append(std::span<const std::byte> bytes) {
  State& state = *state_;
  if (state.hash) XXH3_128bits_update(state.hash.get(), bytes.data(), bytes.size());
  state.size += bytes.size();
  const bool large = bytes.size() >= kLarge;
  if (large || state.gathered.size() + bytes.size() > kGathered) {
    if (Status status = flush(); !status) return status;
    if (large) return state.put(bytes);
  }
  state.gathered.insert(state.gathered.end(), bytes.begin(), bytes.end());
  return {};
}

Status File::flush() {
  const Status status = state_->put(state_->gathered);
  state_->gathered.clear();
  return status;
}

Status File::overwrite(std::uint64_t offset, std::span<const std::byte> bytes) {
  State& state = *state_;
  const std::uint64_t flushed = state.size - state.gathered.size();
  if (offset >= flushed) {
    std::ranges::copy(bytes, state.gathered.begin() + static_cast<std::ptrdiff_t>(offset - flushed));
    return {};
  }
  if (Status status = flush(); !status) return status;
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(state.file, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return write_failure(state.path, written < 0 ? errno : EIO);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
  return {};
}

Status File::sync() {
  const int reason = state_->streams ? 0 : sync_file(state_->file);
  return reason == 0 ? Status() : Status(write_failure(state_->path, reason));
}

Status File::become_part(bool synced) {
  State& state = *state_;
  if (Status status = flush(); !status) return status;
  if (synced && state.options.durable != Durable::kNo) {
    if (Status status = sync(); !status) return status;
  }
  // No other process knows its name yet; file systems without locks have one writer at a time.
  if (!state.options.lock) ::flock(state.file, LOCK_EX | LOCK_NB);
  const std::string part = part_of(state.target);
  if (std::rename(state.grows.c_str(), part.c_str()) != 0) return write_failure(state.path, errno);
  forget(std::exchange(state.watched, -1));
  state.grows = part;
  state.options.keep_part = state.options.lock = true;
  return {};
}

Result<FileDigest> File::finish() {
  State& state = *state_;
  if (Status status = flush(); !status) return status.error();
  int reason = 0;
  if (!state.streams) {
    reason = state.close_and_rename();
  } else if (::close(std::exchange(state.file, -1)) != 0 && errno != EINTR) {
    reason = errno;
  }
  if (reason != 0) return write_failure(state.path, reason);
  return digest();
}

void File::discard() {
  state_->options.keep_part = false;
  state_.reset();  // of a finished file nothing is left
}

std::uint64_t File::size() const { return state_->size; }

FileDigest File::digest() const {
  FileDigest digest;
  digest.bytes = state_->size;
  if (!state_->hash) return digest;
  const XXH128_hash_t hash = XXH3_128bits_digest(state_->hash.get());
  digest.hash = {hash.high64, hash.low64};
  return digest;
}

bool File::streams() const { return state_->streams; }

int File::descriptor() const { return state_->file; }

Status write_file(const std::string& path, std::span<const std::byte> bytes, const FileOptions& options) {
  auto file = File::open(path, options);
  if (!file) return file.error();
  if (Status status = file->append(bytes); !status) return status;
  const auto digest = file->finish();
  return digest ? Status() : Status(digest.error());
}

Status write_file(const std::string& path, std::string_view text, const FileOptions& options) {
  return write_file(path, std::as_bytes(std::span(text)), options);
}

Error write_failure(const std::string& path, int code) {
  if (is_shortage(code)) return shortage(code, path);
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

std::optional<FileStamp> file_stamp(const std::string& path) {
  // Times of FAT, and of ext4 with small inodes, have steps of up to 2 s; all others of the system's clock.
  constexpr std::int64_t kStepNs = 100'000'000, kCoarseStepNs = 2'100'000'000, kCoarseNs = 10'000'000;
  const auto ns = [](const timespec& time) { return time.tv_sec * 1'000'000'000 + time.tv_nsec; };
  struct stat now {};
  timespec clock{};
  errno = 0;
  ::clock_gettime(CLOCK_REALTIME, &clock);
  if (::stat(path.c_str(), &now) != 0 || !S_ISREG(now.st_mode)) return std::nullopt;
  const bool coarse = ns(now.st_mtim) % kCoarseNs == 0 && ns(now.st_ctim) % kCoarseNs == 0;
  return FileStamp{{now.st_dev, now.st_ino},
                   static_cast<std::uint64_t>(now.st_size),
                   ns(now.st_mtim),
                   ns(now.st_ctim),
                   ns(clock) - ns(now.st_ctim) > (coarse ? kCoarseStepNs : kStepNs)};
}

bool same_file(const std::string& a, const std::string& b) {
  const std::optional<FileId> first = file_id(a);
  return first && first == file_id(b);
}

bool is_file(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0) return S_ISREG(status.st_mode);
  return (errno == ENOTDIR || (errno == ENOENT && is_page_name(path))) && entry_bytes(path).has_value();
}

bool is_stream(const std::string& path) {
  struct stat status {};
  const bool there = ::stat(path.c_str(), &status) == 0;
  return path == "-" || (there && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode));
}

Status check_can_write(const std::string& path, bool makes_folders) {
  namespace fs = std::filesystem;
  std::error_code error;
  fs::path folder = fs::absolute(path, error);
  if (fs::is_symlink(folder, error)) folder = fs::weakly_canonical(folder, error);
  if (!makes_folders || !folder.has_filename() || fs::is_regular_file(folder, error)) folder = folder.parent_path();
  while (makes_folders && !fs::exists(folder, error) && folder.has_relative_path()) folder = folder.parent_path();
  const auto refused = [&](const std::string& why) { return Error{Fault::kOutput, fmt::format("{}: {}", path, why)}; };
  if (!fs::exists(folder, error))
    return refused(fmt::format("there is no folder {}; make it or name another one", fs::path(path).parent_path().string()));
  if (!fs::is_directory(folder, error)) return refused(folder.string() + " is no folder; name another one");
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    return refused(fmt::format("no file can be made in {}: {}; name another folder", folder.string(), std::strerror(errno)));
  return {};
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
  const std::optional<std::uint64_t> entry = fs::exists(status) ? std::nullopt : entry_bytes(file);
  if (!entry && !fs::is_regular_file(status))
    return refuse(fs::exists(status) ? "is a link or a device, not a file" : "is missing");
  if (!bytes) return {};
  if (entry) error.clear();
  const std::uintmax_t size = entry ? *entry : fs::file_size(file, error);
  if (error) return refuse("is missing");
  return size == *bytes ? Status() : Status(refuse(fmt::format("{} bytes, the manifest says {}", size, *bytes)));
}

Result<bool> bring_file(const std::string& from, const std::string& to) {
  namespace fs = std::filesystem;
  if (entry_bytes(from)) {
    const auto content = read_file(from, {});
    if (!content) return content.error();
    const Status written = write_file(to, *content, {.lock = false, .follow = false, .durable = Durable::kNo});
    return written ? Result<bool>(false) : written.error();
  }
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
