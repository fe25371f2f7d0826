#include "pipeline/output/slice_directory.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <system_error>
#include <vector>

#include "pipeline/job/decisions.h"
#include "pipeline/manifest/kept.h"
#include "pipeline/output/directory.h"
#include "stages/formats/slice_format.h"
#include "stages/support/io/leftovers.h"
#include "stages/support/io/replaceable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// Per-layer files of an earlier job in any format, such as 000042.svg.
std::vector<fs::path> layer_files(const Job& job) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(fs::path(job.output) / "layers", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::string_view rest = name;
    std::uint32_t index = 0;
    if (take_layer_index(rest, index) && (rest == ".svg" || rest == ".cli")) files.push_back(entry->path());
  }
  return files;
}

Error cannot(const fs::path& path, const std::error_code& error) {
  return {Fault::kOutput, fmt::format("{}: {}", path.string(), error.message())};
}

}  // namespace

std::string_view slice_extension(const Job& job) {
  const std::string_view extension = write::find_slice_format(job.slice.format)->extension;
  return extension.empty() ? ".cli" : extension;
}

std::string slice_file_name(const Job& job) {
  const std::string stem = fs::path(job.parts.front().path).stem().string();
  // part.stl.gz is part
  const std::string name =
      fs::path(stem).extension() == ".stl" || fs::path(stem).extension() == ".obj" ? fs::path(stem).stem().string() : stem;
  return fmt::format("{}{}", name.empty() ? "part" : name, slice_extension(job));
}

Status check_slice_output(const Job& job) {
  if (const auto there = is_directory(job.output); !there || !*there) return there ? Status() : there.error();
  std::error_code error;
  if (Status busy = write::check_not_being_written(job.output + "/manifest.json"); !busy) return busy;
  const std::vector<ManifestFile> manifests = find_manifests(job.output);
  const OnRecord record = find_on_record(job.output);
  const bool replaces = job.overwrite || (job.resume && (record.finished || record.begun));
  if (!job.overwrite && !job.resume && !manifests.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: holds {}; {}, or name another directory", job.output,
                                            manifests.front().partial ? "an interrupted job" : "a job",
                                            manifests.front().partial ? "go on with --resume, start over with --overwrite"
                                                                      : "replace it with --overwrite")};
  }
  const bool knows_plan = job.overwrite || job.slice.file_a_layer || record.finished || record.all_made;
  for (const std::string& name : {std::string("job.toml"), slice_file_name(job)}) {
    const fs::path file = fs::path(job.output) / name;
    for (const PartRequest& part : job.parts) {
      if (write::same_file(file.string(), part.path)) {
        return Error{Fault::kUsage,
                     fmt::format("{}: is a part of the job and would be replaced; name another directory", file.string())};
      }
    }
    // Never replaces a user's job file: a job file of lamina has a manifest beside it.
    if (name == "job.toml" && fs::exists(file, error) && (!replaces || manifests.empty() || !knows_plan)) {
      return Error{Fault::kUsage,
                   fmt::format("{}: is there already, and the job would be kept in it; name another directory", file.string())};
    }
  }
  const bool asks = !job.overwrite && record.begun && job.slice.file_a_layer == record.finished;
  const auto known = [&](const fs::path& file) { return is_on_record(record, file.filename().string()); };
  if (replaces && (!asks || std::ranges::all_of(layer_files(job), known))) return {};
  if (!layer_files(job).empty()) {
    return Error{Fault::kUsage,
                 fmt::format("{}/layers: holds layers; replace them with --overwrite, or name another directory", job.output)};
  }
  const fs::path file = fs::path(job.output) / slice_file_name(job);
  if (!job.slice.file_a_layer && fs::exists(file, error)) {
    return Error{Fault::kUsage,
                 fmt::format("{}: is there already; replace it with --overwrite, or name another directory", file.string())};
  }
  return {};
}

// Its name needs no random digits: the directory is claimed.
fs::path waiting_layers(const Job& job) { return fs::path(job.output) / "layers.lamina.part"; }

Status prepare_waiting_layers(const Job& job, bool keeps) {
  const fs::path waiting = waiting_layers(job);
  if (keeps) return {};
  std::error_code error;
  fs::remove_all(waiting, error);  // of a run that was killed; a link goes, not what it leads to
  if (!error && job.slice.file_a_layer && !fs::create_directory(waiting, error) && !error) {
    error = std::make_error_code(std::errc::file_exists);
  }
  return error ? Status(cannot(waiting, error)) : Status();
}

namespace {

/// The one file of an earlier job, if it has another name than that of this one and is no part of it.
std::optional<fs::path> other_slice_file(const Job& job) {
  const auto head = read_manifest_head(job.output + "/manifest.json");
  if (!head || head->file.empty() || (!job.slice.file_a_layer && head->file == slice_file_name(job))) return std::nullopt;
  const fs::path file = fs::path(job.output) / head->file;
  for (const PartRequest& part : job.parts) {
    if (write::same_file(file.string(), part.path)) return std::nullopt;
  }
  return file;
}

}  // namespace

std::vector<fs::path> earlier_slices(const Job& job) {
  if (!job.overwrite && !job.resume) return {};
  std::vector<fs::path> earlier;
  if (auto other = other_slice_file(job)) earlier.push_back(std::move(*other));  // while its manifest still tells of it
  const OnRecord record = find_on_record(job.output);
  const bool all = job.overwrite || (job.slice.file_a_layer && !record.finished);
  for (fs::path& file : layer_files(job)) {
    if (all || is_on_record(record, file.filename().string())) earlier.push_back(std::move(file));
  }
  for (const char* name : {"job.toml", "manifest.json"}) earlier.push_back(fs::path(job.output) / name);
  return earlier;
}

Status replace_slices(const Job& job, const std::vector<fs::path>& earlier) {
  std::error_code error;
  for (const fs::path& file : earlier) {
    fs::remove(file, error);
    if (error) return cannot(file, error);
  }
  return job.slice.file_a_layer ? take_waiting(waiting_layers(job).string(), job.output + "/layers") : Status();
}

void remove_waiting_layers(const Job& job) {
  std::error_code error;
  fs::remove_all(waiting_layers(job), error);
  if (error) write::note_left_behind(waiting_layers(job).string(), error.value());
}

}  // namespace lamina::pipeline
