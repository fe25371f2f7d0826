#include "pipeline/watch/moves.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>
#include <vector>

#include "pipeline/job/errors.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/rename.h"
#include "stages/support/io/sync.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kErrorEnding = ".error.txt";

std::string numbered(const std::string& stem, int number) { return number < 2 ? stem : fmt::format("{}-{}", stem, number); }

/// The same with an ending, as long as names of files may be: 255 bytes.
std::string numbered_name(const std::string& stem, int number, const std::string& ending) {
  constexpr std::size_t kMaxBytes = 255;
  const fs::path path(stem);
  const std::string name = path.filename(), last = numbered("", number) + ending;
  if (name.size() + last.size() <= kMaxBytes) return stem + last;
  return joined(path.parent_path(), short_name(name, kMaxBytes - std::min(last.size(), kMaxBytes / 2))) + last;
}

/// Where an input is while it is moved in several steps, so that no later file of its name is taken for it.
std::string hidden_name(const std::string& from, const WatchedInput& input) {
  const fs::path path(from);
  const Hash128 key = hash_text(
      fmt::format("{} {} {} {}", path.filename().string(), input.stamp.inode, input.stamp.bytes, input.stamp.mtime_ns));
  return joined(path.parent_path(), ".moving-" + hex(key));
}

bool exists(const std::string& path) {
  std::error_code ignored;
  return fs::exists(fs::symlink_status(path, ignored));
}

/// errors  kOutput
Status make_folder_of(const std::string& file) {
  std::error_code error;
  const fs::path folder = fs::path(file).parent_path();
  if (!folder.empty()) fs::create_directories(folder, error);
  return error ? Status(failure(Fault::kOutput, "{}: {}", folder.string(), error.message())) : Status();
}

/// returns  0, EEXIST, or the system's reason
int copy_file_new(const std::string& from, const std::string& to) {
  errno = 0;
  auto in = FileReader::open(from, {.fault = Fault::kOutput});
  auto out = in ? File::open(to, {.follow = false, .replace = false}) : Result<File>(in.error());
  const auto reason = [&] { return exists(to) ? EEXIST : errno != 0 ? errno : EIO; };
  if (!out) return reason();
  std::string piece(256 << 10, '\0');
  for (std::uint64_t at = 0; at < in->size(); at += piece.size()) {
    piece.resize(static_cast<std::size_t>(std::min<std::uint64_t>(piece.size(), in->size() - at)));
    if (!in->read_at(at, piece)) return EIO;
    errno = 0;
    if (!out->append(piece)) return reason();
  }
  errno = 0;
  return out->finish() ? 0 : reason();
}

/// Gives an input with a hidden name, which no program replaces, its new name: by a link, or as a copy on another file system,
/// which may be there since a killed run. returns  0, EEXIST if another file has the name, or the system's reason
int move_hidden(const std::string& hidden, const WatchedInput& input, const std::string& to) {
  int reason = ::link(hidden.c_str(), to.c_str()) == 0 || same_file(hidden, to) ? 0 : errno;
  if (reason != 0 && reason != EEXIST) reason = copy_file_new(hidden, to);
  if (reason == EEXIST) {
    const auto digest = digest_file(to, input.stamp.bytes);
    if (digest && digest->hash == input.hash) reason = 0;
  }
  if (reason != 0) return reason;
  return ::unlink(hidden.c_str()) == 0 ? 0 : errno;
}

/// A file that came under the name while it was moved is not lost: it gets a name in the watched folder again.
std::optional<std::string> take_back(const std::string& to, const std::string& from) {
  const std::string ending = endings_of(from), stem = from.substr(0, from.size() - ending.size());
  for (int number = 1; rename_new(to, numbered_name(stem, number, ending)) == EEXIST; ++number) {
  }
  return std::nullopt;
}

/// The files of a result in its work folder: the side files first.
std::vector<std::string> made_files(const WatchedJob& job, const std::string& base) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(job.work, error), end; !error && at != end; at.increment(error)) {
    if (std::string name = at->path().filename().string(); name.starts_with(base)) names.push_back(std::move(name));
  }
  std::ranges::sort(names, {}, [&](const std::string& name) { return name == base + job.ending; });
  return names;
}

/// The name of the result with its folders: one that is a finished job itself can have no results in it.
std::string folder_stem(const std::string& root, const std::string& name) {
  std::string path = root;
  const fs::path folder = fs::path(name).parent_path();
  for (const fs::path& part : folder) {
    const std::string stem = joined(path, part.string());
    for (int number = 1;; ++number) {
      path = numbered(stem, number);
      std::error_code ignored;
      if (!exists(path) || (fs::is_directory(path, ignored) && !exists(path + "/manifest.json"))) break;
    }
  }
  return joined(path, fs::path(name).filename().string());
}

/// Whether a path leads through the directory of a finished job below the root.
bool is_in_job(const std::string& root, const std::string& stem) {
  fs::path at = fs::path(stem).parent_path();
  for (; at.string().size() > root.size() && at.has_relative_path(); at = at.parent_path()) {
    if (exists((at / "manifest.json").string())) return true;
  }
  return false;
}

/// Moves the files of a result to their names; all or, if one of the names is taken, none. returns  of rename_new()
int move_result(const WatchedJob& job, const std::string& base) {
  std::vector<std::pair<std::string, std::string>> moved;
  for (const std::string& name : made_files(job, base)) {
    std::string from = joined(job.work, name), to = job.stem + name.substr(base.size());
    const int reason = rename_new(from, to);
    if (reason == EEXIST) {
      for (const auto& [before, after] : moved) rename_new(after, before);
    }
    if (reason != 0) return reason;
    moved.emplace_back(std::move(from), std::move(to));
  }
  return 0;
}

}  // namespace

std::string endings_of(const std::string& path) {
  std::size_t end = path.size();
  while (lower_case(path.substr(0, end)).ends_with(".gz")) end -= 3;
  const std::size_t dot = path.rfind('.', end - 1);
  return dot == std::string::npos || path.find('/', dot) != std::string::npos ? path.substr(end) : path.substr(dot);
}

Result<std::optional<std::string>> move_input(const std::string& from, const WatchedInput& input, const std::string& folder) {
  const std::string ending = endings_of(input.path),
                    stem = joined(folder, input.path.substr(0, input.path.size() - ending.size())),
                    hidden = hidden_name(from, input);
  if (Status made = make_folder_of(stem); !made) return made.error();
  bool is_hidden = stamp_of(hidden) == input.stamp;  // since an earlier run
  for (int number = 1;; ++number) {
    const std::string to = numbered_name(stem, number, ending);
    int reason = EXDEV;
    if (!is_hidden) {
      if (stamp_of(from) != input.stamp) return std::optional<std::string>();
      reason = rename_in_one_step(from, to);
      if (reason == 0 && stamp_of(to) != input.stamp) return take_back(to, from);
      const bool in_steps = reason == EXDEV || reason == EINVAL || reason == ENOSYS;
      if (in_steps && std::rename(from.c_str(), hidden.c_str()) != 0) reason = errno;
      is_hidden = in_steps && (reason == EXDEV || reason == EINVAL || reason == ENOSYS);
      if (is_hidden && stamp_of(hidden) != input.stamp) return take_back(hidden, from);
    }
    if (is_hidden) reason = move_hidden(hidden, input, to);
    if (reason == EEXIST) continue;
    if (reason != 0) {
      if (is_hidden) rename_new(hidden, from);
      return failure(Fault::kOutput, "{}: cannot be moved to {}: {}", from, to, std::strerror(reason));
    }
    sync_folder_of(to);
    sync_folder_of(from);
    return std::optional<std::string>(to);
  }
}

std::optional<std::string> find_moved(const WatchedInput& input, const std::string& folder) {
  const std::string ending = endings_of(input.path),
                    stem = joined(folder, input.path.substr(0, input.path.size() - ending.size()));
  std::optional<std::string> found;
  for (int number = 1;; ++number) {
    const std::string path = numbered_name(stem, number, ending);
    const auto stamp = stamp_of(path);
    if (stamp == input.stamp) return path;
    if (!stamp && !exists(path)) return found;
    // A copy on another file system has a stamp of its own.
    if (const auto digest = digest_file(path, input.stamp.bytes); digest && digest->hash == input.hash) found = path;
  }
}

void choose_stem(WatchedJob& job) {
  const std::string stem = folder_stem(job.root, job.name);
  const std::string base = fs::path(job.name).filename().string();
  const std::vector<std::string> files =
      job.result.code == 0 ? made_files(job, base) : std::vector<std::string>{base + kErrorEnding};
  for (int number = 1;; ++number) {
    job.stem = numbered(stem, number);
    const bool taken =
        std::ranges::any_of(files, [&](const std::string& file) { return exists(job.stem + file.substr(base.size())); });
    if (!taken) break;
  }
  if (files.empty()) job.stem.clear();
}

std::string result_path(const WatchedJob& job) {
  return job.stem.empty() ? "" : job.stem + (job.result.code == 0 ? job.ending : kErrorEnding);
}

bool is_lost(const WatchedJob& job) {
  return job.result.code == 0 && !job.stem.empty() && !exists(result_path(job)) &&
         made_files(job, fs::path(job.name).filename().string()).empty();
}

Status publish(WatchedJob& job, const std::function<Status(const WatchedJob&)>& again) {
  const auto rename_job = [&] {
    choose_stem(job);
    return again(job);
  };
  if (job.result.code != 0) {
    const std::string text = job.result.reason + "\n";
    while (true) {
      const std::string path = result_path(job);
      if (Status made = make_folder_of(path); !made) return made;
      const Status written = write_file(path, text, {.follow = false, .replace = false});
      const auto there = read_file(path, {});
      if (there && *there == text) break;
      if (!written && !there) return written;
      if (Status status = rename_job(); !status) return status;
    }
  } else if (!job.stem.empty()) {
    const std::string base = fs::path(job.name).filename().string();
    int reason = 0;
    do {
      if (reason == EEXIST || is_in_job(job.root, job.stem)) {
        if (Status status = rename_job(); !status) return status;
      }
      if (Status made = make_folder_of(job.stem); !made) return made;
    } while ((reason = move_result(job, base)) == EEXIST);
    if (reason != 0) return write_failure(job.stem, reason);
    sync_folder_of(job.stem);
  }
  remove_work(job.work);
  return {};
}

std::error_code make_work(const std::string& work) {
  constexpr int kTries = 1000;  // another job may remove the empty folder of both in between
  std::error_code error = std::make_error_code(std::errc::no_such_file_or_directory);
  for (int i = 0; i < kTries && error == std::errc::no_such_file_or_directory; ++i) fs::create_directories(work, error);
  return error;
}

void remove_work(const std::string& work) {
  std::error_code ignored;
  if (work.empty()) return;
  fs::remove_all(work, ignored);
  fs::remove(fs::path(work).parent_path(), ignored);  // if it is empty
}

}  // namespace lamina::pipeline
