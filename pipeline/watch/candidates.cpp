#include "pipeline/watch/candidates.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/watch/moves.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

std::string folder_of(const std::string& file) { return fs::path(file).parent_path().string(); }
std::string stem_of(const std::string& file) { return file.substr(0, file.size() - endings_of(file).size()); }
bool is_settings_name(const std::string& file) { return fs::path(file).filename() == kWatchFile; }

/// A path relative to the watched folder; "" if it is outside.
std::string below_root(const std::string& path, const std::string& root) {
  std::error_code ignored;
  const auto real = [&](const std::string& name) { return fs::weakly_canonical(full_path(name), ignored); };
  const fs::path base = (real(root) / "").parent_path(), file = real(fs::path(path).parent_path()) / fs::path(path).filename(),
                 below = file.lexically_relative(base);
  return below.empty() || *below.begin() == ".." || below == "." ? "" : below.string();
}

}  // namespace

void Candidates::find(const std::set<std::string>& active, const std::atomic<bool>& stop) {
  stop_ = &stop;
  ready.clear();
  used.clear();
  named_.clear();
  stems_.clear();
  by_stem_.clear();
  held_.clear();
  folders_.clear();
  waiting_.clear();
  any_unsettled = false;
  left = Fault::kInterrupted;
  read_job_files();
  for (const auto& [file, job] : jobs_) {
    if (!active.contains(file)) add_job(file);
  }
  for (const auto& [file, state] : folder_.files()) {
    if (is_toml_name(file) || named_.contains(file)) continue;
    // Parts that are being planned still need their job file.
    used[file].insert(file);
    if (const auto job = by_stem_.find(stem_of(file)); job != by_stem_.end()) used[job->second].insert(file);
    if (!active.contains(file)) add_part(file);
  }
  for (const auto& [file, line] : waiting_) {
    std::string& before = reported_[file];
    if (before != line) fresh_.push_back(line);
    before = line;
  }
  std::erase_if(reported_, [&](const auto& entry) { return !waiting_.contains(entry.first); });
}

std::vector<std::string> Candidates::take_waits() { return std::exchange(fresh_, {}); }

void Candidates::waits(const std::string& file, Fault fault, const std::string& line) {
  waiting_[file] = line;
  if (left == Fault::kInterrupted) left = fault;
}

bool Candidates::is_complete(const std::string& file) {
  const double settle = settings_of(folder_of(file)).settings.settle_seconds;
  const auto found = folder_.files().find(file);
  if (found == folder_.files().end()) {  // removed since it was named
    any_unsettled = true;
    return false;
  }
  const WatchedFile& state = found->second;
  if (folder_.is_complete(file, settle, *stop_)) return true;
  if (const std::string lacks = Folder::lack_of(state, settle); !lacks.empty()) {
    const std::string path = folder_.path_of(file);
    waits(file, Fault::kInput,
          fmt::format("{}: incomplete: {}; waiting for the rest", path,
                      lacks.starts_with(path) ? lacks.substr(path.size() + 2) : lacks));
  } else {
    any_unsettled = true;
  }
  return false;
}

/// Of a folder, relative to the watched one. A settings file counts once it is complete.
const Candidates::SettingsOfFolder& Candidates::settings_of(const std::string& folder) {
  const auto known = folders_.find(folder);
  if (known != folders_.end()) return known->second;
  SettingsOfFolder found = folder.empty() ? SettingsOfFolder{settings_} : settings_of(folder_of(folder));
  const std::string file = joined(folder, kWatchFile);
  if (const auto state = folder_.files().find(file); state != folder_.files().end()) {
    const double settle = found.settings.settle_seconds;
    if (!folder_.is_complete(file, settle, *stop_)) {
      found.valid = false;
      if (!Folder::lack_of(state->second, settle).empty()) {
        waits(file, Fault::kUsage, folder_.path_of(file) + ": is empty or incomplete, or open for writing; its parts wait");
      } else {
        any_unsettled = true;
      }
    } else if (Status read = read_watch_file(folder_.path_of(file), folder_.root(), read_, found.settings); !read) {
      found.valid = false;
      waits(file, Fault::kUsage, read.error().message + "; its parts wait");
    }
  }
  return folders_[folder] = std::move(found);
}

/// Reads job files that are complete, each once.
void Candidates::read_job_files() {
  known_jobs_ = std::exchange(jobs_, {});
  for (const auto& [file, state] : folder_.files()) {
    if (!is_toml_name(file) || is_settings_name(file)) continue;
    if (!is_complete(file)) {
      held_.insert(folder_of(file));
      continue;
    }
    JobFile& job = jobs_[file];
    if (const auto known = known_jobs_.find(file); known != known_jobs_.end() && known->second.stamp == state.stamp) {
      job = known->second;
    } else {
      Job read;
      job.stamp = state.stamp;
      job.valid = read_job(folder_.path_of(file), read).ok();
      if (!job.valid) read.parts.clear();
      for (const PartRequest& part : read.parts) {
        const std::string below = below_root(part.path, folder_.root());
        below.empty() || !folder_.files().contains(below) ? job.outside.push_back(part.path) : job.inside.push_back(below);
      }
    }
    // A part may have gone or come since the job was read.
    std::erase_if(job.inside, [&](const std::string& part) {
      if (folder_.files().contains(part)) return false;
      job.outside.push_back(folder_.path_of(part));
      return true;
    });
    std::erase_if(job.outside, [&](const std::string& path) {
      const std::string below = below_root(path, folder_.root());
      const bool inside = !below.empty() && folder_.files().contains(below);
      if (inside) job.inside.push_back(below);
      return inside;
    });
    for (const std::string& part : job.inside) {
      named_.insert(part);
      used[part].insert(file);
    }
    if (job.inside.empty() && job.outside.empty()) by_stem_[stem_of(file)] = file;
  }
  for (const auto& [file, state] : folder_.files()) {
    if (!is_toml_name(file) && !named_.contains(file)) stems_.insert(stem_of(file));
  }
}

bool Candidates::is_held(const std::string& folder) const {
  for (std::string above = folder;; above = folder_of(above)) {
    if (held_.contains(above)) return true;
    if (above.empty()) return false;
  }
}

/// A job of a job file, unless it belongs to a part next to it.
void Candidates::add_job(const std::string& file) {
  const JobFile& job = jobs_.at(file);
  const bool names_parts = !job.inside.empty() || !job.outside.empty();
  if (!names_parts) {
    if (stems_.contains(stem_of(file))) return;
    if (job.valid)
      return waits(file, Fault::kUsage, folder_.path_of(file) + ": names no part, and no part has its name; waiting");
  }
  if (!is_utf8(file)) return waits(file, Fault::kUsage, folder_.path_of(file) + ": the name is not UTF-8; rename it");
  const SettingsOfFolder& settings = settings_of(folder_of(file));
  Candidate found{file, file, {file}, job.outside, settings.settings};
  bool complete = settings.valid;
  for (const std::string& part : job.inside) {
    complete = is_complete(part) && complete;
    if (std::ranges::find(found.inside, part) == found.inside.end()) found.inside.push_back(part);
  }
  for (const std::string& part : job.outside) {
    std::error_code ignored;
    if (fs::exists(part, ignored)) continue;
    complete = false;
    waits(file, Fault::kInput, fmt::format("{}: waiting for {}", folder_.path_of(file), part));
  }
  if (complete) ready.push_back(std::move(found));
}

void Candidates::add_part(const std::string& file) {
  const std::string folder = folder_of(file);
  if (!is_utf8(file)) return waits(file, Fault::kUsage, folder_.path_of(file) + ": the name is not UTF-8; rename it");
  const SettingsOfFolder& settings = settings_of(folder);
  Candidate found{file, "", {file}, {}, settings.settings};
  if (const auto job = by_stem_.find(stem_of(file)); job != by_stem_.end()) {
    found.job_file = job->second;
    found.inside.push_back(job->second);
  }
  if (is_complete(file) && settings.valid && !is_held(folder)) ready.push_back(std::move(found));
}

}  // namespace lamina::pipeline
