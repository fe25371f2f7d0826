#include "pipeline/watch/folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <memory>
#include <thread>
#include <utility>

#include "pipeline/job/errors.h"
#include "stages/load/load.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kReadAgainAfter{1};  // of a file that could not be read
constexpr std::uint32_t kEvents = IN_CLOSE_WRITE | IN_MOVED_TO | IN_MODIFY | IN_CREATE | IN_MOVED_FROM | IN_DELETE |
                                  IN_ONLYDIR | IN_DONT_FOLLOW | IN_EXCL_UNLINK;

FileStamp stamp_from(const struct stat& status) {
  return {status.st_ino, static_cast<std::uint64_t>(status.st_size),
          std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec};
}

bool is_watched_name(const std::string& name) {
  return !name.starts_with('.') && (is_toml_name(name) || load::is_part_name(name));
}

/// Whether a process has the file open for writing; nothing if the system does not state it: it does on local file systems,
/// for files of this user. A lease is refused while a writer has the file open; a writer that comes meanwhile waits for an
/// instant.
std::optional<bool> has_writer(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (file < 0) return std::nullopt;
  const bool leased = ::fcntl(file, F_SETLEASE, F_RDLCK) == 0, refused = !leased && errno == EAGAIN;
  if (leased) ::fcntl(file, F_SETLEASE, F_UNLCK);
  ::close(file);
  return leased || refused ? std::optional(refused) : std::nullopt;
}

/// Whether another process has a lock that excludes this one; watchers that start have some for an instant.
bool is_refused(int folder, int lock) {
  for (int attempt = 0; attempt < 20; ++attempt) {
    if (::flock(folder, lock | LOCK_NB) == 0 || errno != EWOULDBLOCK) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

bool is_watched(const fs::path& folder) {
  const int file = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) return false;
  const bool refused = is_refused(file, LOCK_SH);
  ::close(file);
  return refused;
}

/// A watched folder above or below; "" if there is none. Hidden folders have watchers of their own. Two watchers that start
/// at once may both find the other one: each has locked its folder.
std::string nested_watch(const std::string& root) {
  std::error_code error, gone;
  const fs::path own = fs::canonical(root, error);
  for (fs::path at = own; at.has_relative_path() && !at.filename().string().starts_with('.');) {
    at = at.parent_path();
    if (is_watched(at)) return at.string();
  }
  constexpr auto kOptions = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator at(own, kOptions, error), end; !error && at != end; at.increment(error)) {
    if (!fs::is_directory(at->symlink_status(gone))) continue;
    if (at->path().filename().string().starts_with('.')) {
      at.disable_recursion_pending();
    } else if (is_watched(at->path())) {
      return at->path().string();
    }
  }
  return {};
}

}  // namespace

std::string joined(const std::string& folder, const std::string& name) {
  return folder.empty() ? name : folder.ends_with('/') ? folder + name : folder + "/" + name;
}

bool is_toml_name(const std::string& path) { return lower_case(path).ends_with(".toml"); }

std::optional<FileStamp> stamp_of(const std::string& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  return stamp_from(status);
}

Result<Folder> Folder::open(const std::string& root, std::vector<std::string> skipped) {
  Folder folder(root, std::move(skipped));
  struct stat status {};
  const int reason = ::stat(root.c_str(), &status) != 0 ? errno : S_ISDIR(status.st_mode) ? 0 : ENOTDIR;
  if (reason != 0)
    return usage("{}: {}; name the folder that is to be watched", root,
                 reason == ENOTDIR ? "is a file, not a folder" : std::strerror(reason));
  if (Status held = folder.hold(); !held)
    return held.error().fault == Fault::kOutput ? held.error()
                                                : usage("{}: cannot be opened; name the folder that is to be watched", root);
  if (const std::string other = nested_watch(root); !other.empty())
    return usage("{}: another watcher has {}, and their files would be planned twice; stop it, or name a folder next to it",
                 root, other);
  std::signal(SIGIO, SIG_IGN);  // of has_writer()
  folder.events_ = ::inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  if (folder.events_ < 0)
    folder.report(fmt::format("no events of the system ({}); the folder is polled", std::strerror(errno)));
  return folder;
}

Folder::Folder(Folder&& other) noexcept
    : root_(std::move(other.root_)),
      skipped_(std::move(other.skipped_)),
      problems_(std::move(other.problems_)),
      reported_(std::move(other.reported_)),
      found_(std::move(other.found_)),
      events_(std::exchange(other.events_, -1)),
      held_(std::exchange(other.held_, -1)),
      folders_(std::move(other.folders_)),
      changes_(std::move(other.changes_)),
      files_(std::move(other.files_)) {}

Folder::~Folder() {
  for (const int file : {events_, held_}) {
    if (file >= 0) ::close(file);
  }
}

std::string Folder::path_of(const std::string& relative) const { return joined(root_, relative); }

void Folder::report(std::string problem) {
  if (found_.insert(problem).second && !reported_.contains(problem)) problems_.push_back(std::move(problem));
}

std::vector<std::string> Folder::take_problems() { return std::exchange(problems_, {}); }

bool Folder::take_events() {
  bool news = false;
  alignas(inotify_event) std::array<char, 64 << 10> space;
  for (ssize_t got; events_ >= 0 && (got = ::read(events_, space.data(), space.size())) > 0;) {
    for (std::size_t at = 0; at < static_cast<std::size_t>(got);) {
      inotify_event event;
      std::memcpy(&event, space.data() + at, sizeof event);
      const std::string name = event.len > 0 ? std::string(space.data() + at + sizeof event) : std::string();
      at += sizeof event + event.len;
      news = news || (event.mask & IN_MODIFY) == 0;
      if ((event.mask & IN_IGNORED) != 0) folders_.erase(event.wd);
      if ((event.mask & IN_Q_OVERFLOW) != 0) {  // what happened to which file is unknown
        for (auto& [file, state] : files_) changes_[file] = Event::kChanged;
      }
      const auto folder = folders_.find(event.wd);
      if (folder == folders_.end() || (event.mask & IN_ISDIR) != 0 || !is_watched_name(name)) continue;
      const std::string file = joined(folder->second, name);
      if ((event.mask & IN_MODIFY) != 0) changes_[file] = Event::kChanged;
      if ((event.mask & IN_MOVED_TO) != 0) changes_[file] = Event::kRenamed;
      const auto known = changes_.find(file);
      if ((event.mask & IN_CLOSE_WRITE) != 0 && (known == changes_.end() || known->second != Event::kRenamed))
        changes_[file] = Event::kClosed;
    }
  }
  return news;
}

void Folder::add_events(const std::string& relative) {
  if (events_ < 0) return;
  const int folder = ::inotify_add_watch(events_, path_of(relative).c_str(), kEvents);
  if (folder >= 0) {
    folders_[folder] = relative;
  } else if (errno == ENOSPC || errno == ENOMEM) {
    report("more folders than the system watches (fs.inotify.max_user_watches); the others are polled");
  }
}

void Folder::take_file(const std::string& relative, std::map<std::string, WatchedFile>& found) {
  const auto stamp = stamp_of(path_of(relative));
  if (!stamp) return;
  const auto known = files_.find(relative);
  WatchedFile& file = found[relative];
  if (known != files_.end()) file = known->second;
  const auto change = changes_.find(relative);
  const bool has_event = change != changes_.end();
  if (known == files_.end() || !(file.stamp == *stamp) || (has_event && change->second == Event::kChanged)) {
    file = {*stamp, WatchedFile::Arrival::kUnknown, Clock::now(), false, {}, {}, false};
  }
  if (!has_event || change->second == Event::kChanged) return;
  file.end.reset();
  file.arrival = change->second == Event::kRenamed ? WatchedFile::Arrival::kRenamed : WatchedFile::Arrival::kClosed;
}

/// returns  false if the folder cannot be read, with the reason in errno
bool Folder::read_folder(const std::string& relative, std::map<std::string, WatchedFile>& found) {
  add_events(relative);  // first: no file that comes later is missed
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir(path_of(relative).c_str()), &::closedir);
  if (!folder) return false;
  errno = 0;
  while (const dirent* entry = ::readdir(folder.get())) {
    const std::string name = entry->d_name;
    if (name.starts_with('.')) continue;
    const std::string below = joined(relative, name);
    struct stat status {};
    const bool is_folder =
        entry->d_type == DT_DIR ||
        (entry->d_type == DT_UNKNOWN && ::lstat(path_of(below).c_str(), &status) == 0 && S_ISDIR(status.st_mode));
    if (!is_folder) {
      if (is_watched_name(name)) take_file(below, found);
    } else if (std::ranges::find(skipped_, below) == skipped_.end() && !read_folder(below, found) && errno != ENOENT) {
      report(fmt::format("{}: {}; its files are not planned", path_of(below), std::strerror(errno)));
    }
    errno = 0;
  }
  return errno == 0;
}

Status Folder::hold() {
  struct stat held {
  }, named{};
  const bool is_same = held_ >= 0 && ::fstat(held_, &held) == 0 && ::stat(root_.c_str(), &named) == 0 &&
                       held.st_dev == named.st_dev && held.st_ino == named.st_ino;
  if (is_same) return {};
  const int folder = ::open(root_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return failure(Fault::kInput, "{}: {}; waiting for the folder", root_, std::strerror(errno));
  // File systems that cannot lock a folder have one watcher by agreement.
  if (is_refused(folder, LOCK_EX)) {
    ::close(folder);
    return failure(Fault::kOutput, "{}: another watcher has this folder right now; stop it, or name another folder", root_);
  }
  if (held_ >= 0) ::close(held_);
  held_ = folder;
  return {};
}

Status Folder::scan() {
  if (Status status = hold(); !status) return status;
  std::map<std::string, WatchedFile> found;
  if (!read_folder("", found)) return failure(Fault::kInput, "{}: {}; waiting for the folder", root_, std::strerror(errno));
  files_ = std::move(found);
  changes_.clear();
  reported_ = std::exchange(found_, {});
  return {};
}

bool Folder::is_complete(const std::string& relative, double settle_seconds, const std::atomic<bool>& stop) {
  const auto found = files_.find(relative);
  if (found == files_.end()) return false;
  WatchedFile& file = found->second;
  const bool settled = Clock::now() - file.unchanged_since >= std::chrono::duration<double>(settle_seconds);
  if (!settled && file.arrival == WatchedFile::Arrival::kUnknown) {
    // It may have been closed before its folder had events. A writer that has it open will close it.
    if (std::exchange(file.writer_checked, true) || has_writer(path_of(relative)) != false) return false;
    file.arrival = WatchedFile::Arrival::kClosed;
  }
  if (!file.end || (file.end->unread && Clock::now() - file.end_read_at >= kReadAgainAfter)) {
    file.end = end_of_file(path_of(relative), stop);
    file.end_read_at = Clock::now();
  }
  const bool renamed = file.arrival == WatchedFile::Arrival::kRenamed;
  const bool complete =
      file.end->content != FileEnd::Content::kMissing && (settled || renamed || file.end->content == FileEnd::Content::kStated);
  file.has_writer = complete && has_writer(path_of(relative)) == true;
  return complete && !file.has_writer;
}

std::string Folder::lack_of(const WatchedFile& file, double settle_seconds) {
  if (!file.end || Clock::now() - file.unchanged_since < std::chrono::duration<double>(settle_seconds)) return {};
  return file.has_writer ? "a program has it open for writing" : file.end->missing;
}

}  // namespace lamina::pipeline
