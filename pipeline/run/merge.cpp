#include "pipeline/run/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <span>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/manifest/compare.h"
#include "pipeline/manifest/inspection_file.h"
#include "pipeline/manifest/kept_sections.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/job_container.h"
#include "pipeline/output/print_program.h"
#include "pipeline/run/inspector.h"
#include "stages/checks/layer_warnings.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/paged.h"
#include "stages/support/io/sync.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

struct Shard {
  std::string directory;
  std::string path;  // of its manifest
  Manifest manifest;
};

Error unmatched(std::string message) { return {Fault::kVerification, std::move(message)}; }

bool covers_all(const ManifestHead& head) { return head.first_layer == 0 && head.last_layer == head.layer_count; }

Result<std::vector<Shard>> read_shards(const std::vector<std::string>& directories, const std::string& output) {
  std::vector<Shard> shards;
  std::vector<fs::path> detected;
  for (const std::string& directory : directories) {
    std::error_code error;
    if (!is_job_folder(directory)) {
      return Error{Fault::kUsage, fmt::format("{}: no such directory; name those that the shards were written to", directory)};
    }
    const fs::path canonical = fs::canonical(directory, error);
    if (std::ranges::find(detected, canonical) != detected.end()) continue;
    detected.push_back(canonical);
    const std::vector<ManifestFile> files = find_manifests(directory);
    if (files.empty()) return unmatched(fmt::format("{}: contains no manifest of a shard", directory));
    for (const ManifestFile& file : files) {
      const std::string path = (fs::path(directory) / file.name).string();
      // An earlier merge into this directory was interrupted, or failed to remove the shards' manifests.
      const bool of_merge = !file.shard && files.back().shard && same_file(directory, output);
      if (of_merge && file.partial) continue;
      if (file.partial) return unmatched(fmt::format("{}: this shard is not finished; run it again with --resume", path));
      Result<Manifest> manifest = read_manifest(path);
      if (!manifest) return manifest.error();
      if (manifest->head.product != Product::kImages)
        return unmatched(fmt::format(
            "{}: belongs to a job without images, and only image shards are merged; plan all layers in one run", path));
      if (!of_merge || !covers_all(manifest->head)) shards.push_back({directory, path, std::move(*manifest)});
    }
  }
  return shards;
}

Status check_coverage(std::vector<Shard>& shards) {
  std::ranges::stable_sort(shards, {}, [](const Shard& shard) { return shard.manifest.head.first_layer; });
  const ManifestHead& job = shards[0].manifest.head;
  std::uint32_t next = 0;
  const Shard* before = nullptr;
  const auto missing = [&](std::uint32_t first, std::uint32_t last) {
    return unmatched(
        fmt::format("layers {} to {} of {} are in no shard; run what is missing", first, last - 1, job.layer_count));
  };
  for (const Shard& shard : shards) {
    const ManifestHead& head = shard.manifest.head;
    if (const std::string what = difference(head, job); !what.empty()) {
      return unmatched(fmt::format("{}: belongs to another job than {}: {}", shard.path, shards[0].path, what));
    }
    if (head.first_layer == head.last_layer) continue;  // more shards than layers
    if (head.first_layer > next) return missing(next, head.first_layer);
    if (head.first_layer < next) {
      return unmatched(fmt::format("{}: contains layer {} that {} contains as well; leave one of them out", shard.path,
                                   head.first_layer, before->path));
    }
    next = head.last_layer;
    before = &shard;
  }
  if (next < job.layer_count) return missing(next, job.layer_count);
  return {};
}

Status bring_file(const fs::path& from, const fs::path& to, MergeReport& report) {
  const auto linked = lamina::bring_file(from.string(), to.string());
  if (!linked) return linked.error();
  ++(*linked ? report.linked : report.copied);
  return {};
}

/// A file of a shard's directory has to have its size; what is copied out of a container or of pages, its hash too.
Status check_file(const std::string& directory, const std::string& name, const Hash128& hash, std::uint64_t bytes) {
  const std::string file = (fs::path(directory) / name).string();
  if (entry_bytes(file)) {
    const std::string fault = fault_of_file(directory, name, hash, bytes);
    return fault.empty() ? Status()
                         : Status(unmatched(fmt::format("{}/{}; run its shard again with --resume", directory, fault)));
  }
  if (!is_compressed(file)) return check_plain(file, bytes);
  if (Status status = check_plain(file); !status) return status;
  const std::string fault = fault_of_stored(file, bytes);
  return fault.empty() ? Status() : Status(unmatched(fault + "; run its shard again with --resume"));
}

// Links every file of a shard into `output`.
Status bring_files(const Shard& shard, const std::string& output, MergeReport& report) {
  const bool in_place = same_file(shard.directory, output);
  const ManifestHead& head = shard.manifest.head;
  const auto bring = [&](const std::string& name, const Hash128& hash, std::uint64_t bytes) -> Status {
    if (name.empty()) return {};  // a format without files, a job without a machine
    const fs::path from = fs::path(shard.directory) / name;
    if (Status status = check_file(shard.directory, name, hash, bytes); !status) return status;
    return in_place ? Status() : bring_file(from, fs::path(output) / name, report);
  };
  for (const LayerRecord& record : shard.manifest.layers) {
    for (const LayerImageFile& image : layer_images(head, record)) {
      if (Status status = bring(image.name, image.record.hash, image.record.bytes); !status) return status;
    }
    const std::string program = program_file_name(record.layer.index, head.program_extension);
    if (Status status = bring(program, record.program.hash, record.program.bytes); !status) return status;
  }
  if (head.machine.empty()) return {};
  // The files that all shards write identically.
  for (const auto& [name, hash] : {std::pair{std::string("program/machine.toml"), head.machine_profile},
                                   {"program/start" + head.program_extension, head.program_start},
                                   {"program/end" + head.program_extension, head.program_end}}) {
    const fs::path from = fs::path(shard.directory) / name;
    if (Status status = check_plain(from.string()); !status) return status;
    if (const std::string fault = fault_of_file(shard.directory, name, hash); !fault.empty())
      return unmatched(fmt::format("{}/{}; run its shard again with --resume", shard.directory, fault));
    if (in_place) continue;
    if (Status status = bring_file(from, fs::path(output) / name, report); !status) return status;
  }
  return {};
}

/// Never replaces files of another job, nor of none: a merge that was killed left its begun manifest.
/// returns  whether a finished manifest says so, of a shard or of all
Result<bool> check_output(const std::string& output, const ManifestHead& head, const Claim& claim) {
  if (const std::string pages = pages_path(output); !pages.empty())
    return usage("{}: is of a job with --container tiff, into which nothing is merged; name another directory with -o", pages);
  bool known = false, finished = false;
  for (const ManifestFile& file : find_manifests(output)) {
    const std::string path = (fs::path(output) / file.name).string();
    if (file.name == "manifest.json.part" && !claim.found()) continue;
    const Result<Manifest> present = read_manifest(path);
    if (!present || !same_job(present->head, head)) {
      return Error{Fault::kUsage, fmt::format("{}: is not of this job; name another directory with -o", path)};
    }
    known = true;
    finished |= !file.partial;
  }
  if (known || !holds_layers(output)) return finished;
  return Error{Fault::kUsage, fmt::format("{}: contains layers without a manifest; name another directory with -o", output)};
}

Status remove_shard_manifests(const std::string& output) {
  for (const ManifestFile& file : find_manifests(output)) {
    const fs::path path = fs::path(output) / file.name;
    std::error_code error;
    remove_sections(path.string());
    if (file.shard) fs::remove(path, error);
    if (error)
      return Error{Fault::kOutput, fmt::format("{}: merged, and not needed any more, but cannot be removed: {}", path.string(),
                                               error.message())};
  }
  return {};
}

/// Of a whole job, whose directory may be one to read only.
Status end_earlier_merge(const std::string& output) {
  const std::string manifest = (fs::path(output) / "manifest.json").string();
  const auto is_of_shard = [](const ManifestFile& file) { return file.shard.has_value(); };
  if (std::ranges::none_of(find_manifests(output), is_of_shard) && !is_file(sections_path(manifest))) return {};
  auto claim = Claim::take(manifest, output);
  return claim ? remove_shard_manifests(output) : Status(claim.error());
}

/// What is there of a job that is whole already, if nothing but its directory is to be merged into it; an earlier merge may
/// have been interrupted while it removed the shards' manifests.
std::optional<Shard> whole_job(const std::vector<std::string>& directories, const std::vector<Shard>& shards,
                               const std::string& output) {
  const auto is_output = [&](const std::string& directory) { return same_file(directory, output); };
  if (!std::ranges::all_of(directories, is_output)) return std::nullopt;
  const std::string path = (fs::path(output) / "manifest.json").string();
  auto manifest = read_manifest(path);
  if (!manifest || manifest->head.product != Product::kImages || !covers_all(manifest->head)) return std::nullopt;
  const auto is_of_it = [&](const Shard& shard) { return same_job(shard.manifest.head, manifest->head); };
  if (!std::ranges::all_of(shards, is_of_it)) return std::nullopt;
  return Shard{output, path, std::move(*manifest)};
}

/// shards  that cover all layers, in their order
Status check(std::span<const Shard> shards, bool allow_empty, MergeReport& report) {
  const ManifestHead& head = shards.front().manifest.head;
  Job job;
  if (Status status = read_job_text(head.job_toml, shards.front().path, job); !status) return unmatched(status.error().message);
  checks::LayerRecords records;
  std::vector<UnfedPowder> unfed;
  for (const JobMaterial& material : head.materials) unfed.push_back({material.name});
  for (const Shard& shard : shards) {
    for (const LayerRecord& record : shard.manifest.layers) {
      records.add(record.layer, record.set_pixels, record.program.lost, record.capped_rows);
      for (std::size_t m = 0; m < unfed.size(); ++m) unfed[m].add(record.layer, record.image_of(m, unfed.size()).unfed_pixels);
      report.microseconds += record.program.microseconds;
    }
  }
  for (const UnfedPowder& powder : unfed) checks::warn_of_unfed(powder, report.warnings);
  return records.check(head.parts, thins(job), allow_empty, report.warnings);
}

/// The findings of the shards' layers, if the shards were to inspect them.
std::optional<Json> inspect(std::span<const Shard> shards, std::vector<Warning>& warnings) {
  std::vector<KeptLayers> kept;
  for (const Shard& shard : shards) kept.push_back({shard.path, shard.manifest.layers});
  WholeInspection found = inspect_kept(shards.front().manifest.head, kept);
  warnings.insert(warnings.end(), found.warnings.begin(), found.warnings.end());
  return std::move(found.facts);
}

/// Gives the files of the shards their places in the directory, and then writes its manifest.
Status merge_into_directory(std::span<const Shard> shards, const std::string& output, const std::optional<Json>& inspection,
                            MergeReport& report) {
  if (Status status = inspection ? check_inspection_file(output) : Status(); !status) return status;
  std::error_code error;
  fs::create_directories(output, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", output, error.message())};
  auto claim = Claim::take((fs::path(output) / "manifest.json").string(), output);
  if (!claim) return claim.error();
  ManifestHead head = shards.front().manifest.head;
  const auto is_known = check_output(output, head, *claim);
  if (!is_known) return is_known.error();
  sweep_partial_files(output);
  if (Status status = check_no_strays(output, {&head, 0, head.layer_count}, true); !status) return status.error();
  if (Status status = check_stays_inside(output); !status) return status.error();
  fs::create_directories(fs::path(output) / "layers", error);
  if (error) return Error{Fault::kOutput, fmt::format("{}/layers: {}", output, error.message())};
  if (!head.machine.empty()) fs::create_directories(fs::path(output) / "program", error);
  if (error) return Error{Fault::kOutput, fmt::format("{}/program: {}", output, error.message())};

  const auto sync = FolderSync::of({(fs::path(output) / "layers").string(), (fs::path(output) / "program").string()});
  head.first_layer = 0;
  head.last_layer = head.layer_count;
  // Begun before any file comes: it identifies the owner of the files for a later merge.
  auto writer = ManifestWriter::open((fs::path(output) / "manifest.json").string(), head, {}, {}, std::move(*claim));
  if (!writer) return writer.error();
  for (const Shard& shard : shards) {
    Status status = bring_files(shard, output, report);
    if (status) continue;
    // It is needed to know files by; in a shard's directory it would be in the way of --resume.
    if (*is_known || report.linked + report.copied == 0) writer->discard();
    return status.error();
  }
  for (const Shard& shard : shards) {
    for (const LayerRecord& record : shard.manifest.layers) {
      if (Status status = writer->append(record); !status) return status.error();
    }
    report.layers += shard.manifest.layers.size();
  }
  // Before the manifest, after which shards are not read again.
  if (Status status = inspection ? write_inspection(output, head, *inspection) : keep_inspection_of(output, head); !status)
    return status.error();
  if (Status status = writer->finish({}, [&sync] { return sync.sync(); }); !status) return status.error();
  if (Status status = remove_shard_manifests(output); !status) return status.error();
  return {};
}

/// Copies the files of the shards into one container, each compared with its hash.
class ContainerMerge {
 public:
  ContainerMerge(std::span<const Shard> shards, MergeReport& report) : shards_(shards), report_(report) {
    head_.first_layer = 0;
    head_.last_layer = head_.layer_count;
  }

  Status run(const std::string& output, const std::optional<Json>& inspection) {
    if (is_file(output) && !is_of_job(output)) return usage("{}: is there already; name another file with -o", output);
    Job job;
    job.output = output;
    const auto begun = read_manifest_head(part_of(container_manifest(job)));
    // Of a merge that was killed nothing is kept, and it starts again.
    job.resume = is_file(output) || (begun && same_job(*begun, head_) && covers_all(*begun));
    if (Status status = check_container(job); !status) return status;
    MadeFolders made;
    auto claim = claim_container(job, made);
    if (!claim) return claim.error();
    KeptContainer damaged;
    damaged.replaces = is_file(output);
    if (damaged.replaces && has_whole_entries(output)) {  // of a merge that was killed at its very end
      remove_or_note(part_of(container_manifest(job)));
      report_.shards = 0;
      report_.layers = head_.layer_count;
      return {};
    }
    auto container = JobContainer::open(job, damaged);
    if (!container) return container.error();
    container_.emplace(std::move(*container));
    auto writer = ManifestWriter::open(container_manifest(job), head_, {}, {}, std::move(*claim));
    if (!writer) return writer.error();
    Status status = add_files(*writer);
    const std::string facts = inspection ? inspection_text(head_, *inspection) : std::string();
    if (status) {
      status = writer->finish_elsewhere(
          [&] { return container_->finish(facts, "manifest.json", part_of(container_manifest(job))); });
    }
    if (status) return status;
    writer->discard();
    container_->discard();
    return status;
  }

 private:
  /// Whether a container has all layers of the same job.
  bool is_of_job(const std::string& path) const {
    const auto there = read_manifest(path + "/manifest.json");
    return there && same_job(there->head, head_) && covers_all(there->head);
  }

  Status add_files(ManifestWriter& writer) {
    const Shard& first = shards_.front();
    const bool program = !head_.machine.empty();
    Status status = program ? add(first, "program/machine.toml", head_.machine_profile) : Status();
    if (status && program) status = add(first, "program/start" + head_.program_extension, head_.program_start);
    for (const Shard& shard : shards_) {
      for (const LayerRecord& record : shard.manifest.layers) {
        for (const LayerImageFile& image : layer_images(head_, record)) {
          if (status && !image.name.empty()) status = add(shard, image.name, image.record.hash, image.record.bytes);
        }
        if (status && program) {
          status = add(shard, program_file_name(record.layer.index, head_.program_extension), record.program.hash,
                       record.program.bytes);
        }
        if (status) status = writer.append(record);
        if (!status) return status;
      }
      report_.layers += shard.manifest.layers.size();
    }
    return program ? add(first, "program/end" + head_.program_extension, head_.program_end) : status;
  }

  Status add(const Shard& shard, const std::string& name, const Hash128& hash, std::optional<std::uint64_t> bytes = {}) {
    if (const std::string fault = fault_of_file(shard.directory, name, hash, bytes); !fault.empty())
      return unmatched(fmt::format("{}/{}; run its shard again with --resume", shard.directory, fault));
    const auto content = read_file((fs::path(shard.directory) / name).string(), {});
    if (!content) return content.error();
    ++report_.copied;
    return container_->add(name, std::as_bytes(std::span(*content)));
  }

  std::span<const Shard> shards_;
  MergeReport& report_;
  ManifestHead head_ = shards_.front().manifest.head;
  std::optional<JobContainer> container_;
};

}  // namespace

Result<MergeReport> merge(const MergeRequest& request) {
  const std::string& output = request.output;
  Result<std::vector<Shard>> shards = read_shards(request.directories, output);
  if (!shards) return shards.error();
  MergeReport report;
  report.output = output;
  if (const auto whole = whole_job(request.directories, *shards, output)) {
    if (Status status = check({&*whole, 1}, true, report); !status) return status.error();
    if (Status status = checks::refuse_warnings(report.warnings); request.strict && !status) return status.error();
    if (Status status = bring_files(*whole, output, report); !status) return status.error();
    if (Status status = end_earlier_merge(output); !status) return status.error();
    report.layers = whole->manifest.layers.size();
    return report;
  }
  if (shards->empty()) return unmatched(fmt::format("{}: contains no manifest of a shard", request.directories.front()));
  if (Status status = check_coverage(*shards); !status) return status.error();
  if (Status status = check(*shards, request.allow_empty, report); !status) return status.error();
  const std::size_t before = report.warnings.size();
  const std::optional<Json> inspection = inspect(*shards, report.warnings);
  const auto is_output = [&](const Shard& shard) { return same_file(shard.directory, output); };
  if (!inspection && report.warnings.size() > before && std::ranges::any_of(*shards, is_output))
    return unmatched(report.warnings.back().text + "; without inspection, merge into another directory");
  if (Status status = checks::refuse_warnings(report.warnings); request.strict && !status) return status.error();
  report.shards = static_cast<std::uint32_t>(shards->size());
  const Status merged = names_container(output) ? ContainerMerge(*shards, report).run(output, inspection)
                                                : merge_into_directory(*shards, output, inspection, report);
  return merged ? Result<MergeReport>(report) : merged.error();
}

}  // namespace lamina::pipeline
