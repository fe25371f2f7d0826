#include "pipeline/watch/moves.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
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

/// errors  kOutput, also if `to` exists
Status copy_file_new(const std::string& from, const std::string& to) {
  auto in = FileReader::open(from, {.fault = Fault::kOutput});
  if (!in) return in.error();
  auto out = File::open(to, {.follow = false, .replace = false});
  if (!out) return out.error();
  std::string piece(256 << 10, '\0');
  for (std::uint64_t at = 0; at < in->size(); at += piece.size()) {
    piece.resize(static_cast<std::size_t>(std::min<std::uint64_t>(piece.size(), in->size() - at)));
    if (!in->read_at(at, piece)) return failure(Fault::kOutput, "{}: cannot be read to its end", from);
    if (Status status = out->append(piece); !status) return status;
  }
  const auto done = out->finish();
  return done ? Status() : Status(done.error());
}

/// As rename_new(), to another file system; EEXIST if another file has the name.
/// returns  whether the file is there and is the input's
Result<bool> copy_over(const std::string& from, const WatchedInput& input, const std::string& to) {
  if (!exists(to)) {
    if (Status copied = copy_file_new(from, to); !copied && !exists(to)) return copied.error();
  }
  const auto digest = digest_file(to, input.stamp.bytes);
  return digest && digest->hash == input.hash;
}

/// A file that came under the name while it was moved is not lost: it gets a name in the watched folder again.
void take_back(const std::string& to, const std::string& from) {
  const std::string ending = endings_of(from), stem = from.substr(0, from.size() - ending.size());
  for (int number = 1; rename_new(to, numbered(stem, number) + ending) == EEXIST; ++number) {
  }
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

}  // namespace

std::string endings_of(const std::string& path) {
  std::size_t end = path.size();
  while (lower_case(path.substr(0, end)).ends_with(".gz")) end -= 3;
  const std::size_t dot = path.rfind('.', end - 1);
  return dot == std::string::npos || path.find('/', dot) != std::string::npos ? path.substr(end) : path.substr(dot);
}

Result<std::optional<std::string>> move_input(const std::string& from, const WatchedInput& input, const std::string& folder) {
  const std::string ending = endings_of(input.path),
                    stem = joined(folder, input.path.substr(0, input.path.size() - ending.size()));
  if (Status made = make_folder_of(stem); !made) return made.error();
  for (int number = 1;; ++number) {
    const std::string to = numbered(stem, number) + ending;
    if (stamp_of(from) != input.stamp) return std::optional<std::string>();
    int reason = rename_new(from, to);
    if (reason == EEXIST) continue;
    if (reason == EXDEV) {
      const Result<bool> copied = copy_over(from, input, to);
      if (!copied) return copied.error();
      if (!*copied) {
        if (stamp_of(from) == input.stamp) continue;  // another file has the name
        return std::optional<std::string>();
      }
      if (stamp_of(from) != input.stamp) return std::optional<std::string>();
      reason = ::unlink(from.c_str()) == 0 ? 0 : errno;
    } else if (reason == 0 && stamp_of(to) != input.stamp) {
      take_back(to, from);
      return std::optional<std::string>();
    }
    if (reason != 0) return failure(Fault::kOutput, "{}: cannot be moved to {}: {}", from, to, std::strerror(reason));
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
    const std::string path = numbered(stem, number) + ending;
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
    if (Status made = make_folder_of(job.stem); !made) return made;
    const std::string base = fs::path(job.name).filename().string();
    for (const std::string& name : made_files(job, base)) {
      int reason = 0;
      while ((reason = rename_new(joined(job.work, name), job.stem + name.substr(base.size()))) == EEXIST) {
        if (Status status = rename_job(); !status) return status;
      }
      if (reason != 0) return write_failure(job.stem + name.substr(base.size()), reason);
    }
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
