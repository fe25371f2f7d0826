#include "pipeline/cache/cached_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include "pipeline/cache/job_key.h"
#include "pipeline/cache/summary_record.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/manifest/layered_file.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/print_program.h"
#include "pipeline/output/toolpath_file.h"
#include "pipeline/run/run.h"
#include "pipeline/run/space.h"
#include "stages/support/clocks.h"
#include "stages/support/hash/tree.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/file.h"
#include "stages/support/io/sync.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kManifest = "manifest";    // of an entry; names of its other files are relative to the output
constexpr std::string_view kToolpaths = "toolpaths";  // the single file of a job
constexpr const char* kFolders[] = {"layers", "program"};

std::string manifest_path_of(const Resolved& resolved) {
  const std::string& output = resolved.job.output;
  return resolved.product == Product::kImages ? output + "/" + manifest_name(resolved.job) : output + ".json";
}

const CachedFile* find_file(const CacheEntry& entry, std::string_view name) {
  const auto found = std::ranges::find(entry.files, name, &CachedFile::name);
  return found == entry.files.end() ? nullptr : &*found;
}

/// Whether the files are all that the manifest names, with their hashes. errors  kInput
Status check_complete(const Manifest& manifest, const std::vector<CachedFile>& files) {
  std::map<std::string_view, const FileDigest*> known;
  for (const CachedFile& file : files) known[file.name] = &file.digest;
  const auto check = [&](const std::string& name, const FileDigest* expected) -> Status {
    const auto found = known.find(name);
    if (found == known.end()) return failure(Fault::kInput, "{}: is missing", name);
    const FileDigest& digest = *found->second;
    const bool same = expected == nullptr || (digest.bytes == expected->bytes && digest.hash == expected->hash);
    return same ? Status() : failure(Fault::kInput, "{}: differs from the manifest", name);
  };
  const ManifestHead& head = manifest.head;
  if (head.product == Product::kMoves) return check(std::string(kToolpaths), &manifest.file);
  std::vector<std::string> programs;  // compressed ones have other hashes in the manifest
  if (!head.machine.empty()) {
    programs = {"program/machine.toml", "program/start" + head.program_extension, "program/end" + head.program_extension};
    for (const LayerRecord& record : manifest.layers)
      programs.push_back(program_file_name(record.layer.index, head.program_extension));
  }
  for (const std::string& name : programs) {
    if (Status status = check(name, nullptr); !status) return status;
  }
  for (const LayerRecord& record : manifest.layers) {
    for (const LayerImageFile& image : layer_images(head, record)) {
      const FileDigest digest{image.record.bytes, image.record.hash};
      if (Status status = image.name.empty() ? Status() : check(image.name, &digest); !status) return status;
    }
  }
  return {};
}

/// A job whose files come from an entry.
class CachedOutput {
 public:
  CachedOutput(JobCache& cache, const Resolved& resolved, const CacheEntry& entry)
      : cache_(cache), resolved_(resolved), job_(resolved.job), entry_(entry) {}

  /// errors  kInput: the entry or one of its objects is missing or damaged, and nothing was written. kUsage: existing output
  ///         must not be replaced. kOutput. kInterrupted
  Status write(const std::atomic<bool>& cancel) {
    std::error_code ignored;
    fresh_ = !fs::exists(fs::symlink_status(job_.output, ignored));
    if (Status status = read_manifest_of_entry(); !status) return status;
    if (Status status = check_free(); !status) return status;
    return resolved_.product == Product::kImages ? write_images(cancel) : write_toolpaths();
  }

  /// After write(). Absent if the output may have other files.
  std::optional<TreeDigest> digest() const {
    if (!fresh_) return std::nullopt;
    std::vector<std::pair<std::string, FileDigest>> files;
    if (resolved_.product == Product::kMoves) {
      files.emplace_back(".", find_file(entry_, kToolpaths)->digest);
      return digest_of(std::move(files));
    }
    const auto manifest = digest_file(manifest_path_of(resolved_));
    if (!manifest) return std::nullopt;
    files.emplace_back(manifest_name(job_), *manifest);
    for (const CachedFile& file : entry_.files) {
      if (file.name != kManifest) files.emplace_back(file.name, file.digest);
    }
    return digest_of(std::move(files));
  }

 private:
  /// The manifest of the cached job, with the names of this one.
  Status read_manifest_of_entry() {
    const CachedFile* file = find_file(entry_, kManifest);
    if (file == nullptr) return failure(Fault::kInput, "no manifest");
    if (Status status = cache_.stream(file->digest, {}); !status) return status;
    Result<Manifest> manifest = read_manifest(cache_.file_of(file->digest));
    if (!manifest || !manifest->complete) return failure(Fault::kInput, "no manifest");
    manifest_ = std::move(*manifest);
    if (Status status = check_complete(manifest_, entry_.files); !status) return status;
    ManifestHead& head = manifest_.head;
    if (head.product != resolved_.product || head.parts.size() != job_.parts.size())
      return failure(Fault::kInput, "the manifest of another job");
    head.job_toml = canonical_job_text(job_, resolved_.product);
    for (std::size_t i = 0; i < head.parts.size(); ++i) head.parts[i].path = fs::path(job_.parts[i].path).filename().string();
    if (!head.file.empty()) head.file = fs::path(job_.output).filename().string();
    return {};
  }

  Status check_free() const {
    std::uint64_t needed = 0;
    for (const CachedFile& file : entry_.files) needed += file.digest.bytes;
    const auto space = job_.overwrite ? std::nullopt : free_space(job_.output);  // the space of the earlier files is not known
    if (!space || space->bytes >= needed) return {};
    return failure(Fault::kOutput, "{}: the job needs {}, and {} are free; free some space, or name another folder with -o",
                   one_line(space->folder), readable_bytes(needed), readable_bytes(space->bytes));
  }

  Result<ManifestWriter> begin_manifest(std::optional<Claim> claim) const {
    return ManifestWriter::open(manifest_path_of(resolved_), manifest_.head, manifest_.layers, {job_.sync, false, {}},
                                std::move(claim));
  }

  Status write_images(const std::atomic<bool>& cancel) {
    MadeFolders made;
    auto claim = prepare_output(job_, made);
    if (!claim) return claim.error();
    auto manifest = begin_manifest(std::move(*claim));
    if (!manifest) return manifest.error();
    Status status = fetch_images(cancel);
    if (status) {
      const FolderSync folders = FolderSync::of({job_.output});
      const auto named = manifest->finish({}, [&]() -> Status {
        for (const char* folder : kFolders) {
          std::error_code ignored;
          if (!fs::exists(waiting_folder(job_, folder), ignored)) continue;
          if (Status taken = take_waiting(waiting_folder(job_, folder), job_.output + "/" + folder); !taken) return taken;
        }
        return job_.sync == Sync::kOff ? Status() : folders.sync();
      });
      if (named) return {};
      status = named.error();
    }
    remove_waiting();
    manifest->discard();
    for (const char* folder : kFolders) {
      std::error_code ignored;
      fs::remove(job_.output + "/" + folder, ignored);  // fails unless it is empty
    }
    made.take_back();
    return status;
  }

  void remove_waiting() const {
    for (const char* folder : kFolders) {
      std::error_code ignored;
      fs::remove_all(waiting_folder(job_, folder), ignored);
    }
  }

  /// Fetches the files into folders that wait for their names.
  Status fetch_images(const std::atomic<bool>& cancel) const {
    remove_waiting();
    for (const char* folder : kFolders) {
      const bool used = std::ranges::any_of(
          entry_.files, [&](const CachedFile& file) { return file.name.starts_with(std::string(folder) + "/"); });
      std::error_code error;
      if (used && !fs::create_directory(waiting_folder(job_, folder), error))
        return failure(Fault::kOutput, "{}: {}", waiting_folder(job_, folder), error.message());
    }
    for (const CachedFile& file : entry_.files) {
      if (file.name == kManifest) continue;
      if (cancel) return failure(Fault::kInterrupted, "interrupted; nothing of it is kept");
      const std::size_t slash = file.name.find('/');
      const std::string folder = file.name.substr(0, slash);
      if (slash == std::string::npos || std::ranges::find(kFolders, folder) == std::end(kFolders) ||
          !is_job_file_name(file.name)) {
        return failure(Fault::kInput, "{}: is no file of a job", file.name);
      }
      const std::string path = fmt::format("{}/{}", waiting_folder(job_, folder), file.name.substr(slash + 1));
      if (Status status = cache_.fetch(file.digest, path); !status) return status;
    }
    return {};
  }

  Status write_toolpaths() {
    const CachedFile* toolpaths = find_file(entry_, kToolpaths);
    if (toolpaths == nullptr) return failure(Fault::kInput, "no toolpaths");
    if (Status status = check_toolpath_output(job_, resolved_.extruder->machine); !status) return status;
    const std::string path = manifest_path_of(resolved_);
    auto claim = Claim::take(path, job_.output);
    if (!claim) return claim.error();
    FileOptions how{.hash = true, .replace = job_.overwrite};
    if (job_.sync == Sync::kOff) how.durable = Durable::kNo;
    auto file = File::open(job_.output, how);
    if (!file) return file.error();
    const auto append = [&](std::span<const char> bytes) { return file->append(std::as_bytes(bytes)); };
    if (Status status = cache_.stream(toolpaths->digest, append); !status) return status;
    auto manifest = begin_manifest(std::move(*claim));
    if (!manifest) return manifest.error();
    const Status named = manifest->finish(file->digest(), [&]() -> Status {
      std::error_code error;  // the older manifest goes before anything that it describes
      fs::remove(path, error);
      if (error) return failure(Fault::kOutput, "{}: {}", path, error.message());
      const auto finished = file->finish();
      return finished ? Status() : Status(finished.error());
    });
    if (!named) manifest->discard();
    return named;
  }

  JobCache& cache_;
  const Resolved& resolved_;
  const Job& job_;
  const CacheEntry& entry_;
  Manifest manifest_;
  bool fresh_ = false;  // nothing was there
};

/// Whether an earlier run left files that only a run can continue or refuse.
bool continues(const Resolved& resolved) {
  const Job& job = resolved.job;
  if (job.resume && has_record(manifest_path_of(resolved))) return true;
  if (resolved.product != Product::kImages || job.overwrite) return false;
  return std::ranges::any_of(kFolders, [&](const char* folder) {
    std::error_code error;
    const fs::path path = fs::path(job.output) / folder;
    return fs::exists(fs::symlink_status(path, error)) && !fs::is_empty(path, error);
  });
}

Status check_output_of_hit(const Resolved& resolved) {
  return resolved.product == Product::kImages ? check_output(resolved.job) : Status();
}

std::vector<std::string> paths_of(const Job& job) {
  std::vector<std::string> paths;
  for (const PartRequest& part : job.parts) paths.push_back(part.path);
  return paths;
}

/// The summary of a cached job. errors  throws JsonError
Summary summary_of_hit(const Resolved& resolved, const CacheEntry& entry) {
  Summary summary = summary_of_record(entry.facts.at("summary"), paths_of(resolved.job));
  summary.product = resolved.product;
  summary.output = resolved.job.output;
  summary.memory_budget_bytes = resolved.job.memory_bytes;
  summary.facts["cache"] = "hit";
  return summary;
}

/// The result, if the entry was good. errors  those of CachedOutput::write() but kInput
Result<std::optional<CachedRun>> take(JobCache& cache, const Hash128& key, const Resolved& resolved,
                                      const ProgressCallback& progress, const std::atomic<bool>& cancel) try {
  const Stopwatch watch;
  if (continues(resolved)) return std::optional<CachedRun>();
  const std::optional<CacheEntry> entry = cache.find(key);
  if (!entry) return std::optional<CachedRun>();
  Summary summary = summary_of_hit(resolved, *entry);
  if (resolved.job.strict && !summary.warnings.empty()) return std::optional<CachedRun>();
  if (Status status = check_output_of_hit(resolved); !status) return status.error();
  progress({ProgressEvent::Stage::kLayers, 0, summary.layers_total});
  CachedOutput output(cache, resolved, *entry);
  if (Status status = output.write(cancel); !status) {
    if (status.error().fault != Fault::kInput) return status.error();
    cache.remove(key);
    return std::optional<CachedRun>();
  }
  progress({ProgressEvent::Stage::kLayers, summary.layers_total, summary.layers_total});
  summary.layer_seconds = watch.elapsed().wall;
  summary.peak_resident_bytes = peak_resident_bytes();
  summary.end.emplace_back(
      "cache", fmt::format("taken from {}; {} were planned in {} before", one_line(cache.folder()),
                           readable_count(summary.layers_total), readable_seconds(entry->facts.at("seconds").get<double>())));
  return std::optional(CachedRun{std::move(summary), output.digest()});
} catch (const JsonError&) {
  cache.remove(key);
  return std::optional<CachedRun>();
}

/// Whether a manifest is that of the job that ran, not of another that has replaced it.
bool is_of_run(const ManifestHead& head, const Resolved& resolved, const Summary& summary) {
  const auto fingerprints = [](const std::vector<PartSummary>& parts) {
    std::vector<std::uint64_t> found;
    for (const PartSummary& part : parts) found.push_back(part.fingerprint);
    return found;
  };
  return head.product == resolved.product && head.version == version() &&
         head.job_toml == canonical_job_text(resolved.job, resolved.product) &&
         fingerprints(head.parts) == fingerprints(summary.parts) && head.layer_count == summary.layers_total;
}

/// Names of the files in a folder of the output. errors  kInput: the folder cannot be read
Result<std::vector<std::string>> names_in(const std::string& output, const char* folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(output + "/" + folder, error), end; !error && at != end; at.increment(error))
    names.push_back(fmt::format("{}/{}", folder, at->path().filename().string()));
  if (error && error != std::errc::no_such_file_or_directory)
    return failure(Fault::kInput, "{}/{}: {}", output, folder, error.message());
  return names;
}

/// Compares the print programs of a job, which were added, with their records: nothing has replaced them.
Status check_programs(const std::string& output, const Manifest& manifest) {
  const ManifestHead& head = manifest.head;
  if (head.machine.empty()) return {};
  const auto check = [&](const std::string& name, const Hash128& hash, std::optional<std::uint64_t> bytes) -> Status {
    const auto digest = digest_content(output + "/" + name, bytes);
    return digest && digest->hash == hash ? Status() : failure(Fault::kInput, "{}: was changed after it was written", name);
  };
  for (const LayerRecord& record : manifest.layers) {
    const std::string name = program_file_name(record.layer.index, head.program_extension);
    if (Status status = check(name, record.program.hash, record.program.bytes); !status) return status;
  }
  if (Status status = check("program/machine.toml", head.machine_profile, {}); !status) return status;
  if (Status status = check("program/start" + head.program_extension, head.program_start, {}); !status) return status;
  return check("program/end" + head.program_extension, head.program_end, {});
}

/// The files of a finished job, as objects.
/// errors  of JobCache::add_object; kInput: another job has replaced files, or others are in its folders
Result<std::vector<CachedFile>> add_files(JobCache& cache, const Resolved& resolved, const Summary& summary) {
  const Job& job = resolved.job;
  const auto own = cache.add_object(manifest_path_of(resolved));
  if (!own) return own.error();
  const Result<Manifest> manifest = read_manifest(cache.file_of(*own));  // a copy that nobody replaces
  if (!manifest) return manifest.error();
  if (!manifest->complete || !is_of_run(manifest->head, resolved, summary))
    return failure(Fault::kInput, "{}: was replaced by another job", job.output);
  std::vector<CachedFile> files{{std::string(kManifest), *own}};
  if (resolved.product == Product::kMoves) {
    const auto toolpaths = cache.add_object(job.output, manifest->file);
    if (!toolpaths) return toolpaths.error();
    files.push_back({std::string(kToolpaths), *toolpaths});
    return files;
  }
  const LayersOfJob layers{&manifest->head, manifest->head.first_layer, manifest->head.last_layer};
  if (!stray_files(job.output, {&layers, 1}).empty()) return failure(Fault::kInput, "{}: contains other files", job.output);
  for (const char* folder : kFolders) {
    const auto names = names_in(job.output, folder);
    if (!names) return names.error();
    for (const std::string& name : *names) {
      const auto digest = cache.add_object(job.output + "/" + name, {}, true);
      if (!digest) return digest.error();
      files.push_back({name, *digest});
    }
  }
  if (Status status = check_complete(*manifest, files); !status) return status.error();
  if (Status status = check_programs(job.output, *manifest); !status) return status.error();
  return files;
}

/// Adds a finished job. errors  those of add_files(); kInput: its parts changed while it ran; kOutput
Status add(JobCache& cache, const Hash128& key, const Resolved& resolved, const Summary& summary) {
  InputDigests now;
  if (job_key(resolved, now).key != key) return failure(Fault::kInput, "a part changed while the job ran");
  auto files = add_files(cache, resolved, summary);
  if (!files) return files.error();
  const double seconds = summary.load_seconds + summary.index_seconds + summary.layer_seconds;
  return cache.add(key, {std::move(*files), Json{{"seconds", seconds}, {"summary", summary_record(summary)}}});
}

}  // namespace

Result<CachedRun> run_with_cache(JobCache& cache, Resolved resolved, const ProgressCallback& progress,
                                 const std::atomic<bool>& cancel) {
  if (Status status = JobCache::check_apart(cache.folder(), resolved.job.output); !status) return status.error();
  const JobKey128 key = job_key(resolved, cache.inputs());
  if (key.key) {
    auto taken = take(cache, *key.key, resolved, progress, cancel);
    if (!taken) return taken.error();
    cache.count(taken->has_value());
    if (*taken) return std::move(**taken);
  }
  const Resolved kept = resolved;
  Result<Summary> summary = run(std::move(resolved), progress, cancel);
  if (!summary) return summary.error();
  const Status added = !key.key          ? Status(Error{Fault::kInput, key.reason})
                       : cache.is_full() ? Status(Error{Fault::kInput, "the cache could not be written"})
                                         : add(cache, *key.key, kept, *summary);
  if (!added && added.error().fault == Fault::kOutput) cache.note_not_added(added.error());
  const std::string text = added ? "added to " + cache.folder() : "not added: " + added.error().message;
  summary->facts["cache"] = added ? "added" : added.error().message;
  summary->end.emplace_back("cache", one_line(text));
  return CachedRun{std::move(*summary), {}};
}

}  // namespace lamina::pipeline
