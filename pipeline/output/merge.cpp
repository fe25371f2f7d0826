#include "pipeline/output/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/output/directory.h"
#include "pipeline/output/print_program.h"
#include "stages/write/manifest/manifest.h"

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
  std::vector<fs::path> seen;
  for (const std::string& directory : directories) {
    std::error_code error;
    if (!fs::is_directory(directory, error)) {
      return Error{Fault::kUsage, fmt::format("{}: no such directory; name those that the shards were written to", directory)};
    }
    const fs::path canonical = fs::canonical(directory, error);
    if (std::ranges::find(seen, canonical) != seen.end()) continue;
    seen.push_back(canonical);
    const std::vector<ManifestFile> files = find_manifests(directory);
    if (files.empty()) return unmatched(fmt::format("{}: holds no manifest of a shard", directory));
    for (const ManifestFile& file : files) {
      const std::string path = (fs::path(directory) / file.name).string();
      // An earlier merge into this directory was interrupted, or failed to remove the shards' manifests.
      const bool of_merge = !file.shard && files.back().shard && fs::equivalent(directory, output, error);
      if (of_merge && file.partial) continue;
      if (file.partial) return unmatched(fmt::format("{}: this shard is not finished; run it again with --resume", path));
      Result<Manifest> manifest = read_manifest(path);
      if (!manifest) return manifest.error();
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
      return unmatched(fmt::format("{}: holds layer {} that {} holds as well; leave one of them out", shard.path,
                                   head.first_layer, before->path));
    }
    next = head.last_layer;
    before = &shard;
  }
  if (next < job.layer_count) return missing(next, job.layer_count);
  return {};
}

// Links a file to another name, or copies it if linking fails. The name appears once the file is complete.
Status bring_file(const fs::path& from, const fs::path& to, MergeReport& report) {
  const fs::path fresh = to.string() + ".part";
  std::error_code error, ignored;
  fs::remove(fresh, ignored);
  fs::create_hard_link(from, fresh, error);
  const bool linked = !error;
  if (!linked) fs::copy_file(from, fresh, error);
  if (!error) fs::rename(fresh, to, error);
  fs::remove(fresh, ignored);  // stays if `to` was a name of the same file already, and after an error
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", to.string(), error.message())};
  ++(linked ? report.linked : report.copied);
  return {};
}

// Links every file of a shard into `output`.
Status bring_files(const Shard& shard, const std::string& output, MergeReport& report) {
  std::error_code error;
  const bool in_place = fs::equivalent(shard.directory, output, error);
  const ManifestHead& head = shard.manifest.head;
  const auto bring = [&](const std::string& name, std::uint64_t bytes) -> Status {
    if (name.empty()) return {};  // a format without files, a job without a machine
    const fs::path from = fs::path(shard.directory) / name;
    const std::uintmax_t size = fs::file_size(from, error);
    if (error) return unmatched(fmt::format("{}: is missing; run its shard again with --resume", from.string()));
    if (size != bytes) {
      return unmatched(
          fmt::format("{}: {} bytes, the manifest says {}; run its shard again with --resume", from.string(), size, bytes));
    }
    return in_place ? Status() : bring_file(from, fs::path(output) / name, report);
  };
  for (const LayerRecord& record : shard.manifest.layers) {
    for (const LayerImageFile& image : layer_images(head, record)) {
      if (Status status = bring(image.name, image.record.bytes); !status) return status;
    }
    const std::string program = program_file_name(record.layer.index, head.program_extension);
    if (Status status = bring(program, record.program.bytes); !status) return status;
  }
  if (head.machine.empty() || in_place) return {};
  // The files that all shards write identically.
  for (const std::string& name :
       {std::string("machine.toml"), "start" + head.program_extension, "end" + head.program_extension}) {
    const fs::path from = fs::path(shard.directory) / "program" / name;
    if (Status status = bring_file(from, fs::path(output) / "program" / name, report); !status) return status;
  }
  return {};
}

}  // namespace

Result<MergeReport> merge(const std::vector<std::string>& directories, const std::string& output) {
  Result<std::vector<Shard>> shards = read_shards(directories, output);
  if (!shards) return shards.error();
  if (shards->empty()) return unmatched(fmt::format("{}: holds no manifest of a shard", directories.front()));
  if (Status status = check_coverage(*shards); !status) return status.error();

  // Never replaces files of another job.
  ManifestHead head = shards->front().manifest.head;
  for (const ManifestFile& file : find_manifests(output)) {
    const std::string path = (fs::path(output) / file.name).string();
    const Result<Manifest> present = read_manifest(path);
    if (!present || present->head.id() != head.id()) {
      return Error{Fault::kUsage, fmt::format("{}: is not of this job; name another directory with -o", path)};
    }
  }
  std::error_code error;
  fs::create_directories(fs::path(output) / "layers", error);
  if (error) return Error{Fault::kOutput, fmt::format("{}/layers: {}", output, error.message())};
  if (!head.machine.empty()) fs::create_directories(fs::path(output) / "program", error);
  if (error) return Error{Fault::kOutput, fmt::format("{}/program: {}", output, error.message())};

  MergeReport report;
  report.output = output;
  report.shards = static_cast<std::uint32_t>(shards->size());
  for (const Shard& shard : *shards) {
    if (Status status = bring_files(shard, output, report); !status) return status.error();
  }
  head.first_layer = 0;
  head.last_layer = head.layer_count;
  Result<ManifestWriter> writer = ManifestWriter::open((fs::path(output) / "manifest.json").string(), head, {});
  if (!writer) return writer.error();
  for (const Shard& shard : *shards) {
    for (const LayerRecord& record : shard.manifest.layers) {
      if (Status status = writer->append(record); !status) return status.error();
    }
    report.layers += shard.manifest.layers.size();
  }
  if (Status status = writer->finish(); !status) return status.error();
  for (const ManifestFile& file : find_manifests(output)) {
    if (file.shard) fs::remove(fs::path(output) / file.name, error);
  }
  return report;
}

}  // namespace lamina::pipeline
