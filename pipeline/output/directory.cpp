#include "pipeline/output/directory.h"

#include <fmt/core.h>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "pipeline/job/decisions.h"
#include "pipeline/job/file.h"
#include "pipeline/manifest/kept_sections.h"
#include "pipeline/output/paged_job.h"
#include "pipeline/output/print_program.h"
#include "stages/data/shortage.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/container.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPartial = ".part";

Error cannot(const fs::path& path, int reason) {
  if (is_shortage(reason)) return shortage(reason, path.string());
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

namespace {

/// What the manifests of a directory say of who else is or was there.
struct OtherRuns {
  bool begun = false, shared = false;  // an earlier run of this job or shard; other shards of the same split
};

/// claim   of the job's own manifest, if it is held
/// errors  kOutput: another run writes now; kUsage: what is there may not be replaced
Result<OtherRuns> check_manifests(const Job& job, const Claim* claim) {
  const std::string own = manifest_name(job);
  OtherRuns found;
  for (const ManifestFile& file : find_manifests(job.output)) {
    const bool claimed = claim != nullptr && file.name == part_of(own);
    if (claimed && !claim->found()) continue;
    const bool is_own = file.name == own || file.name == part_of(own);
    const auto refuse = [&](std::string_view what, std::string_view advice) {
      return Error{Fault::kUsage, fmt::format("{}/{}: {}; {}", job.output, file.name, what, advice)};
    };
    if (file.partial && !claimed && !joins(job, file)) {
      const std::string path = fmt::format("{}/{}", job.output, file.name.substr(0, file.name.size() - kPartial.size()));
      if (Status busy = check_not_being_written(path); !busy) return busy.error();
    }
    found.begun |= is_own;
    if (joins(job, file)) {
      found.shared = true;
    } else if (is_own && !job.resume && !job.overwrite) {
      if (file.partial) return refuse("an interrupted job", "continue with --resume, or start over with --overwrite");
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

std::string waiting_folder(const Job& job, std::string_view folder) {
  return fmt::format("{}/{}.lamina.part", job.output, folder);
}

Result<bool> is_directory(const Job& job) {
  count(Decision::kOutput);
  std::error_code error;
  const fs::file_status status = fs::status(job.output, error);
  if (fs::is_directory(status)) return true;
  if (!fs::exists(status)) {
    if (const Status made = job.dry_run ? Status() : check_can_write(job.output, true); !made) return made.error();
    return false;
  }
  return Error{Fault::kOutput, fmt::format("{}: is a file, not a directory; name another one with -o", job.output)};
}

Status check_output(const Job& job) {
  if (const auto there = is_directory(job); !there || !*there) return there ? Status() : there.error();
  const auto found = check_manifests(job, nullptr);
  if (!found) return found.error();
  const bool known = job.resume && has_record(job.output + "/" + manifest_name(job));
  if (!known && !job.overwrite && !found->shared && !layer_files(job.output).empty()) {
    return Error{Fault::kUsage,
                 fmt::format("{}/layers: contains layers {}; replace them with --overwrite, or name another directory",
                             job.output, found->begun ? "next to a manifest without a header" : "without a manifest")};
  }
  return check_kind_of_output(job);
}

Status check_shard_fits(const Job& job, const ManifestHead& head) {
  if (!job.shard) return {};
  const std::string own = manifest_name(job);
  for (const ManifestFile& file : find_manifests(job.output)) {
    const bool is_own = file.name == own || file.name == own + std::string(kPartial);
    if (is_own ? !job.overwrite : !joins(job, file)) continue;
    const std::string path = job.output + "/" + file.name;
    const auto earlier = read_manifest_head(path);
    if (earlier && same_job(*earlier, head)) continue;
    if (is_own) {
      return Error{Fault::kUsage, fmt::format("{}: belongs to another job, whose layers a shard cannot clear away; remove {} "
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

Result<Claim> claim_output(const Job& job, MadeFolders& made) {
  if (const std::error_code error = made.make(job.output)) return cannot(job.output, error.value());
  auto claim = Claim::take(job.output + "/" + manifest_name(job), job.output);
  if (!claim) return claim.error();
  if (Status status = check_begun_manifest(part_of(job.output + "/" + manifest_name(job))); !status) return status.error();
  const auto found = check_manifests(job, &*claim);
  if (!found) return found.error();
  return claim;
}

Status remove_manifests(const Job& job) {
  for (const ManifestFile& file : find_manifests(job.output)) {
    if (joins(job, file) || file.name == part_of(manifest_name(job))) continue;  // the claim is in that name
    const fs::path path = fs::path(job.output) / file.name;
    std::error_code error;
    remove_sections(path.string());
    fs::remove(path, error);
    if (error) return cannot(path, error.value());
  }
  return {};
}

Result<Claim> prepare_output(const Job& job, MadeFolders& made) {
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
  for (const fs::path& position : {directory, layers}) {
    if (::access(position.c_str(), W_OK | X_OK) != 0) return cannot(position, errno);
  }
  remove_leftovers(job.output, [](std::string_view name) { return name.starts_with("inspection"); });
  for (const char* folder : {"layers", "program"}) {
    fs::remove_all(waiting_folder(job, folder), error);
    if (error) return cannot(waiting_folder(job, folder), error.value());
  }
  if (!job.overwrite) {
    if (!job.shard) sweep_partial_files(job.output);
    return claim;
  }
  if (Status status = remove_manifests(job); !status) return status.error();
  if (job.shard) return claim;
  if (Status status = remove_layers(job.output); !status) return status.error();
  if (job.machine.profile.empty()) fs::remove(directory / "program", error);  // fails if other files remain
  return claim;
}

namespace {

bool writes(const LayersOfJob& job, const fs::path& name) {
  const ManifestHead& head = *job.head;
  const std::string file = name.filename().string(), whole = name.generic_string();
  LayerRecord record;
  std::uint32_t& index = record.layer.index;
  bool partial = false;
  const auto has_layer = [&] { return !partial && index >= job.first && index < job.last; };
  if (name.parent_path() == "layers") {
    return read_layer_file_name(file, index, partial) && has_layer() &&
           std::ranges::any_of(layer_images(head, record), [&](const LayerImageFile& image) { return image.name == whole; });
  }
  if (head.machine.empty()) return false;
  if (read_program_file_name(file, index, partial))
    return has_layer() && program_file_name(index, head.program_extension) == whole;
  return file == "machine.toml" || file == "start" + head.program_extension || file == "end" + head.program_extension;
}

}  // namespace

std::vector<std::string> stray_files(const std::string& directory, std::span<const LayersOfJob> jobs) {
  std::vector<std::string> strays;
  for (const char* folder : {"layers", "program"}) {
    for (const std::string& file : names_in_folder((fs::path(directory) / folder).string())) {
      const fs::path name = fs::path(folder) / file;
      if (std::ranges::none_of(jobs, [&](const LayersOfJob& job) { return writes(job, name); }))
        strays.push_back(name.generic_string());
    }
  }
  std::sort(strays.begin(), strays.end());
  return strays;
}

Status check_no_strays(const std::string& directory, const LayersOfJob& job, bool all) {
  std::vector<std::string> strays = stray_files(directory, {&job, 1});
  std::erase_if(strays, [&](const std::string& name) {
    const std::string file = fs::path(name).filename().string();
    const bool being_written = file.ends_with(kPartial) || !named_by_temporary(file).empty();
    return being_written || (!all && !is_job_file_name(name));
  });
  if (strays.empty()) return {};
  const std::string more = strays.size() == 1 ? "" : fmt::format(", like {} more", strays.size() - 1);
  return Error{Fault::kUsage, fmt::format("{}/{}: is not of this job{}; remove it, or name another directory", directory,
                                          strays.front(), more)};
}

FileOptions layer_file_options(const Job& job) {
  return {.lock = false, .follow = false, .durable = job.sync == Sync::kLayer ? Durable::kBytes : Durable::kNo};
}

Result<std::vector<LayerRecord>> layers_that_hold(const std::string& directory, const std::string& finished,
                                                  const ManifestHead& head) {
  std::string path = finished;
  if (std::error_code error; !is_file(path) && !fs::exists(path, error)) {
    path += ".part";
    if (!has_manifest_head(path)) return std::vector<LayerRecord>{};
  }

  auto manifest = read_manifest(path);
  if (!manifest) return manifest.error();
  if (!same_job(manifest->head, head)) {
    const std::string what = difference(head, manifest->head);
    return Error{Fault::kUsage, fmt::format("{}: belongs to another job ({}); choose another directory, or --overwrite", path,
                                            what.empty() ? "its parts or keys differ" : what)};
  }
  const ManifestHead& was = manifest->head;
  if (was.first_layer < head.first_layer || was.last_layer > head.last_layer) {
    return Error{Fault::kUsage,
                 fmt::format("{}: contains layers {}:{}, which {}:{} would not keep; resume with the same --layers or more, or "
                             "choose another directory and join them by lamina merge",
                             path, was.first_layer, was.last_layer, head.first_layer, head.last_layer)};
  }
  const std::vector<LayerRecord>& recorded = manifest->layers;
  std::vector<char> holds(recorded.size(), 1);
  tbb::parallel_for(std::size_t{0}, recorded.size(), [&](std::size_t i) {
    const LayerRecord& record = recorded[i];
    const auto hold = [&](const std::string& file, std::uint64_t bytes, const Hash128& hash) {
      if (file.empty()) return true;  // a format without files, a job without a machine
      const auto digest = digest_content(directory + "/" + file, bytes);
      return digest.ok() && digest->bytes == bytes && digest->hash == hash;
    };
    holds[i] = std::ranges::all_of(
                   layer_images(head, record),
                   [&](const LayerImageFile& image) { return hold(image.name, image.record.bytes, image.record.hash); }) &&
               hold(program_file_name(record.layer.index, head.program_extension), record.program.bytes, record.program.hash);
  });
  std::vector<LayerRecord> kept;
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    if (holds[i] != 0) kept.push_back(recorded[i]);
  }
  return kept;
}

ManifestHead plan_head(const Plan& plan) {
  ManifestHead head;
  head.product = plan.product;
  head.version = version();
  head.job_toml = canonical_job_text(plan.job, plan.product);
  head.layer_count = plan.layer_count;
  head.first_layer = plan.range[0];
  head.last_layer = plan.range[1];
  head.parts = plan.scene->parts;
  for (PartSummary& part : head.parts) part.path = std::filesystem::path(part.path).filename().string();
  return head;
}

}  // namespace lamina::pipeline
