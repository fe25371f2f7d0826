#include "pipeline/output/directory.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <tuple>

#include "pipeline/job/decisions.h"
#include "stages/data/text/number_text.h"
#include "stages/write/image_format.h"
#include "stages/write/leftovers.h"
#include "stages/write/manifest/manifest.h"
#include "stages/write/program/dialect.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPartial = ".part";

bool take_end(std::string_view& text, std::string_view end) {
  if (!text.ends_with(end)) return false;
  text.remove_suffix(end.size());
  return true;
}

/// The same for the ending of a temporary file.
bool take_temporary_end(std::string_view& name) {
  const std::string_view named = write::named_by_temporary(name);
  if (named.empty()) return take_end(name, kPartial);
  name = named;
  return true;
}

bool is_manifest(std::string_view name, ManifestFile& file) {
  file = {};
  file.name = name;
  file.partial = take_end(name, kPartial);
  if (name == "manifest.json") return true;
  if (!name.starts_with("manifest-") || !take_end(name, ".json")) return false;
  name.remove_prefix(std::string_view("manifest-").size());
  const std::size_t of = name.find("-of-");
  if (of == std::string_view::npos) return false;
  std::array<std::uint32_t, 2> shard{};
  if (!read_shard(fmt::format("{}/{}", name.substr(0, of), name.substr(of + 4)), shard).empty()) return false;
  file.shard = shard;
  return true;
}

template <class Visit>
void for_each_entry(const fs::path& directory, Visit visit) {
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) visit(*entry);
}

// Layer files of any earlier job, including half-written ones, and their print programs in program/.
std::vector<fs::path> layer_files(const std::string& directory) {
  std::vector<fs::path> found;
  for_each_entry(fs::path(directory) / "program", [&](const fs::directory_entry& entry) {
    std::uint32_t index = 0;
    bool partial = false;
    if (read_program_file_name(entry.path().filename().string(), index, partial)) found.push_back(entry.path());
  });
  for_each_entry(fs::path(directory) / "layers", [&](const fs::directory_entry& entry) {
    std::uint32_t index = 0;
    bool partial = false;
    if (read_layer_file_name(entry.path().filename().string(), index, partial)) found.push_back(entry.path());
  });
  return found;
}

// The other files in program/, of any dialect, and their temporary ones.
std::vector<fs::path> program_frames(const std::string& directory) {
  std::vector<fs::path> found;
  for_each_entry(fs::path(directory) / "program", [&](const fs::directory_entry& entry) {
    const std::string file = entry.path().filename().string();
    const std::string_view named = write::named_by_temporary(file), name = named.empty() ? file : named;
    const bool frame = std::ranges::any_of(write::dialects(), [&](const write::Dialect& one) {
      return name == fmt::format("start{}", one.extension) || name == fmt::format("end{}", one.extension);
    });
    if (frame || name == "machine.toml") found.push_back(entry.path());
  });
  return found;
}

Error cannot(const fs::path& path, int reason) {
  return {Fault::kOutput, fmt::format("{}: {}", path.string(), std::strerror(reason))};
}

// Shards of the same split share the directory.
bool joins(const Job& job, const ManifestFile& file) {
  return job.shard && file.shard && (*job.shard)[1] == (*file.shard)[1] && (*job.shard)[0] != (*file.shard)[0];
}

}  // namespace

std::string manifest_name(const Job& job) {
  if (!job.shard) return "manifest.json";
  return fmt::format("manifest-{}-of-{}.json", (*job.shard)[0] + 1, (*job.shard)[1]);
}

std::vector<ManifestFile> find_manifests(const std::string& directory) {
  std::vector<ManifestFile> found;
  for_each_entry(directory, [&](const fs::directory_entry& entry) {
    ManifestFile file;
    if (is_manifest(entry.path().filename().string(), file)) found.push_back(std::move(file));
  });
  constexpr std::array<std::uint32_t, 2> kWhole{};
  std::sort(found.begin(), found.end(), [&](const ManifestFile& a, const ManifestFile& b) {
    const auto [a_index, a_count] = a.shard.value_or(kWhole);
    const auto [b_index, b_count] = b.shard.value_or(kWhole);
    return std::tie(a_count, a_index, a.partial) < std::tie(b_count, b_index, b.partial);
  });
  return found;
}

bool take_layer_index(std::string_view& name, std::uint32_t& index) {
  const auto [stop, error] = std::from_chars(name.data(), name.data() + name.size(), index);
  const auto digits = static_cast<std::size_t>(stop - name.data());
  if (error != std::errc() || digits < 6 || (digits > 6 && name.front() == '0')) return false;
  name.remove_prefix(digits);
  return true;
}

bool read_layer_file_name(std::string_view name, std::uint32_t& index, bool& partial) {
  partial = take_temporary_end(name);
  std::string_view& extension = name;
  if (!take_layer_index(name, index)) return false;
  if (extension.starts_with('-')) extension.remove_prefix(std::min(extension.find('.'), extension.size()));  // a material
  return std::ranges::any_of(write::image_formats(), [&](const write::ImageFormat& format) {
    return !extension.empty() && extension == format.extension;
  });
}

bool read_program_file_name(std::string_view name, std::uint32_t& index, bool& partial) {
  partial = take_temporary_end(name);
  return take_layer_index(name, index) &&
         std::ranges::any_of(write::dialects(), [&](const write::Dialect& one) { return name == one.extension; });
}

namespace {

/// What the manifests of a directory say of who else is or was there.
struct Neighbours {
  bool begun = false, shared = false;  // an earlier run of this job or shard; other shards of the same split
};

/// claim   of the job's own manifest, if it is held
/// errors  kOutput: another run writes now; kUsage: what is there may not be replaced
Result<Neighbours> check_manifests(const Job& job, const write::Claim* claim) {
  const std::string own = manifest_name(job);
  Neighbours found;
  for (const ManifestFile& file : find_manifests(job.output)) {
    const bool claimed = claim != nullptr && file.name == write::part_of(own);
    if (claimed && !claim->found()) continue;
    const bool is_own = file.name == own || file.name == write::part_of(own);
    const auto refuse = [&](std::string_view what, std::string_view advice) {
      return Error{Fault::kUsage, fmt::format("{}/{}: {}; {}", job.output, file.name, what, advice)};
    };
    if (file.partial && !claimed && !joins(job, file)) {
      const std::string path = fmt::format("{}/{}", job.output, file.name.substr(0, file.name.size() - kPartial.size()));
      if (Status busy = write::check_not_being_written(path); !busy) return busy.error();
    }
    found.begun |= is_own;
    if (joins(job, file)) {
      found.shared = true;
    } else if (is_own && !job.resume && !job.overwrite) {
      if (file.partial) return refuse("an interrupted job", "go on with --resume, or start over with --overwrite");
      return refuse("a finished job",
                    "replace it with --overwrite, check and keep it with --resume, or name another "
                    "directory");
    } else if (!is_own && (job.shard || !job.overwrite)) {
      return refuse("a job that was split otherwise",
                    job.shard ? "name another directory" : "replace it with --overwrite, or name another directory");
    }
  }
  return found;
}

}  // namespace

Result<bool> is_directory(const std::string& output) {
  count(Decision::kOutput);
  std::error_code error;
  const fs::file_status status = fs::status(output, error);
  if (!fs::exists(status) || fs::is_directory(status)) return fs::exists(status);
  return Error{Fault::kOutput, fmt::format("{}: is a file, not a directory; name another one with -o", output)};
}

Status check_output(const Job& job) {
  if (const auto there = is_directory(job.output); !there || !*there) return there ? Status() : there.error();
  const auto found = check_manifests(job, nullptr);
  if (!found) return found.error();
  const bool known = job.resume && has_record(job.output + "/" + manifest_name(job));
  if (!known && !job.overwrite && !found->shared && !layer_files(job.output).empty()) {
    return Error{Fault::kUsage,
                 fmt::format("{}/layers: holds layers {}; replace them with --overwrite, or name another directory", job.output,
                             found->begun ? "beside a record without its head" : "without a manifest")};
  }
  return {};
}

bool holds_layers(const std::string& directory) {
  return !layer_files(directory).empty() || !program_frames(directory).empty();
}

Status check_shard_fits(const Job& job, const ManifestHead& head) {
  if (!job.shard) return {};
  const std::string own = manifest_name(job);
  for (const ManifestFile& file : find_manifests(job.output)) {
    const bool is_own = file.name == own || file.name == own + std::string(kPartial);
    if (is_own ? !job.overwrite : !joins(job, file)) continue;
    const std::string path = job.output + "/" + file.name;
    const auto earlier = read_manifest_head(path);
    if (earlier && earlier->id() == head.id()) continue;
    if (is_own) {
      return Error{Fault::kUsage, fmt::format("{}: is of another job, whose layers a shard cannot clear away; remove {} "
                                              "first, or name another directory",
                                              path, job.output)};
    }
    if (!earlier && file.partial) continue;  // killed before its head was whole
    if (!earlier) return earlier.error();
    return Error{Fault::kUsage,
                 fmt::format("{}: is a shard of another job ({}); name another directory", path, difference(head, *earlier))};
  }
  return {};
}

Status check_stays_inside(const std::string& directory) {
  for (const char* name : {"layers", "program"}) {
    const fs::path place = fs::path(directory) / name;
    std::error_code error;
    if (!fs::is_symlink(place, error)) continue;
    const fs::path target = fs::weakly_canonical(place, error), inside = fs::weakly_canonical(directory, error);
    const fs::path near = target.lexically_relative(inside);
    if (!near.empty() && *near.begin() != "..") continue;
    return Error{Fault::kOutput, fmt::format("{}: is a link that leads out of {}; remove it", place.string(), directory)};
  }
  return {};
}

Result<write::Claim> claim_output(const Job& job, write::MadeFolders& made) {
  if (const std::error_code error = made.make(job.output)) return cannot(job.output, error.value());
  auto claim = write::Claim::take(job.output + "/" + manifest_name(job), job.output);
  if (!claim) return claim.error();
  if (Status status = check_begun_manifest(write::part_of(job.output + "/" + manifest_name(job))); !status)
    return status.error();
  const auto found = check_manifests(job, &*claim);
  if (!found) return found.error();
  return claim;
}

Result<write::Claim> prepare_output(const Job& job, write::MadeFolders& made) {
  auto claim = claim_output(job, made);
  if (!claim) return claim.error();
  if (Status status = check_stays_inside(job.output); !status) return status.error();
  const fs::path directory = job.output, layers = directory / "layers";
  std::error_code error;
  fs::create_directories(layers, error);
  if (error) return cannot(layers, error.value());
  if (!job.machine.profile.empty()) {
    fs::create_directories(directory / "program", error);
    if (error) return cannot(directory / "program", error.value());
  }
  if (!fs::is_directory(layers)) {
    return Error{Fault::kOutput, fmt::format("{}: is a file, not a directory; remove it", layers.string())};
  }
  for (const fs::path& place : {directory, layers}) {
    if (::access(place.c_str(), W_OK | X_OK) != 0) return cannot(place, errno);
  }
  if (!job.overwrite) {
    if (!job.shard) sweep_partial_files(job.output);
    return claim;
  }
  for (const ManifestFile& file : find_manifests(job.output)) {
    if (joins(job, file) || file.name == write::part_of(manifest_name(job))) continue;  // the claim is in that name
    fs::remove(directory / file.name, error);
    if (error) return cannot(directory / file.name, error.value());
  }
  if (job.shard) return claim;
  if (Status status = remove_layers(job.output); !status) return status.error();
  if (job.machine.profile.empty()) fs::remove(directory / "program", error);  // fails if other files remain
  return claim;
}

write::FileOptions layer_file_options(const Job& job) {
  return {.lock = false, .follow = false, .durable = job.sync == Sync::kLayer ? write::Durable::kBytes : write::Durable::kNo};
}

Status remove_layers(const std::string& directory) {
  std::error_code error;
  std::vector<fs::path> old = layer_files(directory);
  for (fs::path& file : program_frames(directory)) old.push_back(std::move(file));
  for (const fs::path& file : old) {
    fs::remove(file, error);
    if (error) return cannot(file, error.value());
  }
  return {};
}

void sweep_partial_files(const std::string& directory, std::uint32_t first, std::uint32_t last) {
  for (const fs::path& file : layer_files(directory)) {
    std::uint32_t index = 0;
    bool partial = false;
    if (!read_layer_file_name(file.filename().string(), index, partial)) {
      read_program_file_name(file.filename().string(), index, partial);
    }
    if (partial && index >= first && index < last) write::remove_or_note(file.string());
  }
  for (const fs::path& file : program_frames(directory)) {
    // Another shard may be writing its own right now.
    const bool whole = first == 0 && last == UINT32_MAX;
    if (whole && !write::named_by_temporary(file.filename().string()).empty()) write::remove_or_note(file.string());
  }
}

}  // namespace lamina::pipeline
