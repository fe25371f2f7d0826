#include "stages/support/io/temporary.h"

#include <dirent.h>
#include <fmt/format.h>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "stages/support/hash/hash.h"
#include "stages/support/io/file.h"

namespace lamina {
namespace {

constexpr int kMaxTries = 16;  // of two runs that begin in the same instant
constexpr std::string_view kMark = ".lamina-", kPart = ".part";
constexpr std::size_t kDigits = 13;        // of 64 bits, 5 each
constexpr std::size_t kLongestName = 200;  // a longer one is cut, so that the temporary name fits into 255 bytes

Error busy(const std::string& path) {
  return {Fault::kOutput, fmt::format("{}: another run is writing here right now; wait for it or name another file", path)};
}

std::string random_digits() {
  static const std::uint64_t secret = [] {
    std::uint64_t bits = 0;
    if (::getrandom(&bits, sizeof bits, 0) != sizeof bits) {
      bits = static_cast<std::uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count());
    }
    return bits;
  }();
  static std::atomic<std::uint64_t> counter{0};
  // splitmix64; the process counts too, for one that was forked has the same secret.
  std::uint64_t bits = secret + static_cast<std::uint64_t>(::getpid()) + (++counter << 32);
  bits = (bits ^ (bits >> 30)) * 0xBF58476D1CE4E5B9u;
  bits = (bits ^ (bits >> 27)) * 0x94D049BB133111EBu;
  bits ^= bits >> 31;
  std::string digits(kDigits, '0');
  for (char& digit : digits) {
    digit = "abcdefghijklmnopqrstuvwxyz234567"[bits & 31];
    bits >>= 5;
  }
  return digits;
}

/// What temporary names of a file begin with.
std::string stem_of(const std::string& name) { return short_name(name, kLongestName); }

}  // namespace

std::string short_name(const std::string& name, std::size_t max_bytes) {
  if (name.size() <= max_bytes) return name;
  const std::string digits = "-" + hex(hash_bytes(std::as_bytes(std::span(name))));
  std::size_t kept = max_bytes - digits.size();
  while (kept > 0 && (static_cast<unsigned char>(name[kept]) & 0xC0) == 0x80) --kept;  // within a character
  return name.substr(0, kept) + digits;
}

namespace {

enum class Lock { kHeld, kTaken, kGone };

/// A lock holds only if the file still has its name.
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
Status remove_stale(const std::string& path, const std::string& part) {
  if (Status status = check_is_file(part); !status) return status;
  const int file = ::open(part.c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return errno == ENOENT ? Status() : Status(write_failure(part, errno));
  const Lock got = take_lock(file, part);
  const int reason = got == Lock::kHeld && ::unlink(part.c_str()) != 0 && errno != ENOENT ? errno : 0;
  ::close(file);
  if (got == Lock::kTaken) return busy(path);
  return reason == 0 ? Status() : Status(write_failure(part, reason));
}

/// The folder of a file, locked while a run reads its names: of several that begin in the same instant one comes first.
class FolderTurn {
 public:
  explicit FolderTurn(const std::string& target) {
    const std::string folder = std::filesystem::path(target).parent_path().string();
    file_ = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    // Another program may hold the folder for long. Without a turn both of two runs may be refused, no more.
    for (int tries = 0; file_ >= 0 && tries < 50; ++tries) {
      if (::flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  FolderTurn(const FolderTurn&) = delete;
  FolderTurn& operator=(const FolderTurn&) = delete;
  ~FolderTurn() {
    if (file_ >= 0) ::close(file_);
  }
  int folder() const { return file_; }

 private:
  int file_ = -1;
};

bool is_temporary_of(std::string_view name, std::string_view stem) {
  const std::string_view named = named_by_temporary(name);
  return !named.empty() && named == stem;
}

/// Whether a process writes the file of that name in a folder. remove  it if none does
bool is_written(int folder, const char* name, const std::string& path, bool remove) {
  const int file = ::openat(folder, name, O_WRONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return false;  // a link, a pipe, or somebody else's
  const bool locked = ::flock(file, LOCK_EX | LOCK_NB) == 0;
  const bool taken = !locked && errno == EWOULDBLOCK;
  if (locked && remove && ::unlinkat(folder, name, 0) != 0 && errno != ENOENT) note_left_behind(path, errno);
  ::close(file);
  return taken;
}

/// Whether another run writes a file.
/// own     a temporary file or part that is passed over
/// remove  temporary files that killed runs left
bool another_writes(int folder, const std::string& target, const std::string& own, bool remove) {
  if (folder < 0) return false;
  const std::filesystem::path position(target);
  const std::string name = position.filename().string(), stem = stem_of(name), part = part_of(name);
  const std::string skipped = std::filesystem::path(own).filename().string();
  const int copy = ::openat(folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const std::unique_ptr<DIR, int (*)(DIR*)> entries(copy < 0 ? nullptr : ::fdopendir(copy), &::closedir);
  bool written = part != skipped && is_written(folder, part.c_str(), part, false);
  while (entries && !written) {
    const dirent* entry = ::readdir(entries.get());
    if (entry == nullptr) break;
    if (!is_temporary_of(entry->d_name, stem) || entry->d_name == skipped) continue;
    written = is_written(folder, entry->d_name, (position.parent_path() / entry->d_name).string(), remove);
  }
  return written;
}

// A signal handler may touch nothing but lock-free atomics.
std::array<std::atomic<const char*>, 1024> watched;
std::atomic<bool> removing{false};
static_assert(std::atomic<const char*>::is_always_lock_free);

std::mutex notes_mutex;
std::vector<std::string> notes;

}  // namespace

std::string part_of(const std::string& file) { return file + std::string(kPart); }

std::string_view named_by_temporary(std::string_view name) {
  const std::size_t ending = kMark.size() + kDigits + kPart.size();
  if (name.size() <= ending || !name.ends_with(kPart)) return {};
  const std::string_view digits = name.substr(name.size() - kPart.size() - kDigits, kDigits);
  if (digits.find_first_not_of("abcdefghijklmnopqrstuvwxyz234567") != std::string_view::npos) return {};
  name.remove_suffix(kDigits + kPart.size());
  return name.ends_with(kMark) ? name.substr(0, name.size() - kMark.size()) : std::string_view();
}

std::string temporary_name(const std::string& target) {
  const std::size_t folder = target.find_last_of('/') + 1;  // 0 without one
  return target.substr(0, folder) + stem_of(target.substr(folder)) + std::string(kMark) + random_digits() + std::string(kPart);
}

Result<Temporary> create_temporary(const std::string& path, const std::string& target, bool lock) {
  std::optional<FolderTurn> turn;
  if (lock) turn.emplace(target);
  for (int tries = 0; tries < kMaxTries; ++tries) {
    Temporary made;
    made.name = temporary_name(target);
    made.file = ::open(made.name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (made.file < 0 && errno == EEXIST) continue;
    if (made.file < 0) return write_failure(path, errno);
    if (!lock) return made;
    const bool held = take_lock(made.file, made.name) == Lock::kHeld;  // not where another run is just inspecting it
    const bool alone = held && !another_writes(turn->folder(), target, made.name, true);
    if (alone) return made;
    remove_or_note(made.name);
    ::close(made.file);
    if (held) break;
  }
  return busy(path);
}

Result<int> create_part(const std::string& path, const std::string& part) {
  const std::string target = part.substr(0, part.size() - kPart.size());
  const FolderTurn turn(target);
  for (int tries = 0; tries < kMaxTries; ++tries) {
    const int file = ::open(part.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (file < 0) {
      if (errno != EEXIST) return write_failure(path, errno);
      if (Status status = remove_stale(path, part); !status) return status.error();
      continue;
    }
    const Lock got = take_lock(file, part);
    const bool alone = got == Lock::kHeld && !another_writes(turn.folder(), target, part, true);
    if (alone) return file;
    if (got == Lock::kHeld) remove_or_note(part);
    ::close(file);
    if (got != Lock::kGone) break;
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

struct Claim::State {
  const std::string part;
  const int file;
  const bool made;
  bool removes = made;
  int watched = removes ? watch(part.c_str()) : -1;

  State(std::string name, int opened, bool is_empty) : part(std::move(name)), file(opened), made(is_empty) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    forget(watched);
    if (removes) remove_or_note(part);
    ::close(file);
  }
};

Claim::Claim(std::unique_ptr<State> state) : state_(std::move(state)) {}
Claim::Claim(Claim&&) noexcept = default;
Claim::~Claim() = default;
bool Claim::found() const { return !state_->made; }

void Claim::hand_over() {
  forget(std::exchange(state_->watched, -1));
  state_->removes = false;
}

Result<Claim> Claim::take(const std::string& path, const std::string& reported) {
  const std::string part = part_of(path);
  for (int tries = 0; tries < kMaxTries; ++tries) {
    if (Status status = check_is_file(part); !status) return status.error();
    const int file = ::open(part.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK, 0666);
    if (file < 0) return write_failure(part, errno);
    const Lock got = take_lock(file, part);
    if (got == Lock::kHeld) {
      struct stat status {};
      const bool empty = ::fstat(file, &status) == 0 && status.st_size == 0;
      Claim claim(std::make_unique<State>(part, file, empty));
      const FolderTurn turn(path);
      another_writes(turn.folder(), path, part, true);  // for what killed runs left
      return claim;
    }
    ::close(file);
    if (got == Lock::kTaken) break;
  }
  return busy(reported);
}

Status check_not_being_written(const std::string& path) {
  const FolderTurn turn(path);
  return another_writes(turn.folder(), path, {}, false) ? Status(busy(path)) : Status();
}

void remove_leftovers(const std::string& folder, const std::function<bool(std::string_view)>& is_of) {
  const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const std::unique_ptr<DIR, int (*)(DIR*)> entries(opened < 0 ? nullptr : ::fdopendir(opened), &::closedir);
  while (const dirent* entry = entries ? ::readdir(entries.get()) : nullptr) {
    const std::string_view named = named_by_temporary(entry->d_name);
    if (!named.empty() && is_of(named)) is_written(opened, entry->d_name, folder + "/" + entry->d_name, true);
  }
}

std::error_code MadeFolders::make(const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code error;
  std::vector<std::string> absent;
  for (fs::path position = folder; !position.empty() && !fs::exists(fs::symlink_status(position, error));
       position = position.parent_path()) {
    if (position.has_filename()) absent.push_back(position.string());
  }
  fs::create_directories(folder, error);
  if (!error) made_.insert(made_.end(), absent.rbegin(), absent.rend());
  return error;
}

void MadeFolders::take_back() {
  for (; !made_.empty(); made_.pop_back()) ::rmdir(made_.back().c_str());  // fails if something is in it
}

int watch(const char* name) {
  for (std::size_t i = 0; i < watched.size(); ++i) {
    const char* free = nullptr;
    if (watched[i].load(std::memory_order_relaxed) == nullptr && watched[i].compare_exchange_strong(free, name)) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

void forget(int which) {
  if (which < 0) return;
  watched[static_cast<std::size_t>(which)].store(nullptr);
  while (removing) ::pause();  // the process is about to end
}

void remove_watched() {
  removing = true;
  for (std::atomic<const char*>& slot : watched) {
    if (const char* name = slot.load()) ::unlink(name);
  }
}

void remove_or_note(const std::string& path) {
  if (::unlink(path.c_str()) != 0 && errno != ENOENT) note_left_behind(path, errno);
}

void note_left_behind(const std::string& path, int reason) {
  const std::lock_guard lock(notes_mutex);
  notes.push_back(fmt::format("{}: temporary file that could not be removed: {}", path, std::strerror(reason)));
}

std::vector<std::string> take_left_behind() {
  const std::lock_guard lock(notes_mutex);
  return std::exchange(notes, {});
}

}  // namespace lamina
