#include "pipeline/output/slice_directory.h"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>
#include <vector>

#include "pipeline/job/decisions.h"
#include "pipeline/output/directory.h"

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
    const std::size_t digits = std::min(name.find_first_not_of("0123456789"), name.size());
    if (digits >= 6 && (entry->path().extension() == ".svg" || entry->path().extension() == ".cli")) {
      files.push_back(entry->path());
    }
  }
  return files;
}

}  // namespace

std::string_view slice_extension(const Job& job) {
  const std::string_view format = job.slice.format;
  return format == "svg" ? ".svg" : format == "3mf" ? ".3mf" : ".cli";
}

std::string slice_file_name(const Job& job) {
  const std::string stem = fs::path(job.parts.front().path).stem().string();
  // part.stl.gz is part
  const std::string name =
      fs::path(stem).extension() == ".stl" || fs::path(stem).extension() == ".obj" ? fs::path(stem).stem().string() : stem;
  return fmt::format("{}{}", name.empty() ? "part" : name, slice_extension(job));
}

Status check_slice_output(const Job& job) {
  count(Decision::kOutput);
  std::error_code error;
  const fs::file_status status = fs::status(job.output, error);
  if (!fs::exists(status)) return {};
  if (!fs::is_directory(status)) {
    return Error{Fault::kOutput, fmt::format("{}: is a file, not a directory; name another one with -o", job.output)};
  }
  const std::vector<ManifestFile> manifests = find_manifests(job.output);
  const bool replaces = job.overwrite || job.resume;
  if (!replaces && !manifests.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: holds {}; {}, or name another directory", job.output,
                                            manifests.front().partial ? "an interrupted job" : "a job",
                                            manifests.front().partial ? "go on with --resume, start over with --overwrite"
                                                                      : "replace it with --overwrite")};
  }
  for (const std::string& name : {std::string("job.toml"), slice_file_name(job)}) {
    const fs::path file = fs::path(job.output) / name;
    for (const PartRequest& part : job.parts) {
      if (fs::equivalent(file, part.path, error)) {
        return Error{Fault::kUsage,
                     fmt::format("{}: is a part of the job and would be replaced; name another directory", file.string())};
      }
    }
    // Never replaces a user's job file: a job file of lamina has a manifest beside it.
    if (name == "job.toml" && fs::exists(file, error) && (!replaces || manifests.empty())) {
      return Error{Fault::kUsage,
                   fmt::format("{}: is there already, and the job would be kept in it; name another directory", file.string())};
    }
  }
  if (replaces) return {};
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

fs::path waiting_layers(const Job& job) { return fs::path(job.output) / "layers.part"; }

Status prepare_slice_directory(const Job& job) {
  if (Status status = check_nobody_came(job); !status) return status;
  std::error_code error;
  if (job.slice.file_a_layer) fs::remove_all(waiting_layers(job), error);  // of a run that was killed
  fs::create_directories(job.slice.file_a_layer ? waiting_layers(job) : fs::path(job.output), error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", job.output, error.message())};
  return {};
}

Status replace_earlier_slices(const Job& job) {
  std::error_code error;
  if (job.overwrite) {
    for (const char* name : {"manifest.json", "job.toml"}) fs::remove(fs::path(job.output) / name, error);
    for (const fs::path& file : layer_files(job)) fs::remove(file, error);
  }
  if (!job.slice.file_a_layer) return {};
  const fs::path layers = fs::path(job.output) / "layers";
  const auto failed = [&] { return Error{Fault::kOutput, fmt::format("{}: {}", layers.string(), error.message())}; };
  fs::rename(waiting_layers(job), layers, error);  // takes the place of an empty directory too
  if (!error) return {};
  error.clear();
  for (fs::directory_iterator entry(waiting_layers(job), error), end; !error && entry != end; entry.increment(error)) {
    fs::rename(entry->path(), layers / entry->path().filename(), error);
    if (error) return failed();
  }
  if (error) return failed();
  fs::remove(waiting_layers(job), error);
  return {};
}

WaitingLayers::~WaitingLayers() {
  std::error_code ignored;
  if (job_.slice.file_a_layer) fs::remove_all(waiting_layers(job_), ignored);
}

}  // namespace lamina::pipeline
