#include "pipeline/output/slice_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "pipeline/job/decisions.h"
#include "pipeline/job/file.h"
#include "pipeline/manifest/layered_file.h"
#include "pipeline/output/directory.h"
#include "stages/data/growth.h"
#include "stages/support/io/file.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {

namespace fs = std::filesystem;

SliceFiles::SliceFiles(const Plan& plan)
    : plan_(plan), format_(*formats::find_slice_format(plan.job.slice.format)), file_a_layer_(plan.job.slice.file_a_layer) {
  const SliceRequest& slice = plan.job.slice;
  head_.parts = plan.sections->names();
  head_.bounds = plan.sections->bounds();
  head_.layers = plan.range[1] - plan.range[0];
  head_.first_bottom = head_.layers > 0 ? plan.layer(plan.range[0]).bottom : 0;
  head_.program = fmt::format("lamina {}", version());
  const Layer last = plan.layer_count > 0 ? plan.layer(plan.layer_count - 1) : Layer{};
  head_.top = std::int64_t{last.bottom} + last.thickness;
  if (format_.make != nullptr) encoder_ = format_.make({slice.empty_first_layer});
}

SliceFiles::~SliceFiles() {
  if (manifest_ && file_a_layer_ && !finished_ && !waits_) remove_waiting_layers(plan_.job);
}

std::string SliceFiles::output() const {
  const Job& job = plan_.job;
  if (job.slice.format == "null") return job.output;
  return job.output + "/" + (file_a_layer_ ? "layers" : slice_file_name(job));
}

Status SliceFiles::open() {
  const Job& job = plan_.job;
  auto claim = claim_output(job, made_);
  if (!claim) return claim.error();
  if (Status status = check_stays_inside(job.output); !status) return status;
  ManifestHead head = plan_head(plan_);
  head.format = job.slice.format;
  const bool one_file = job.slice.format != "null" && !file_a_layer_;
  if (file_a_layer_ && encoder_) head.extension = slice_extension(job);
  if (one_file) head.file = slice_file_name(job);
  if (one_file && encoder_) return open_single(head, std::move(*claim));
  const std::string manifest_path = job.output + "/manifest.json", waiting = waiting_layers(job).string();
  if (job.resume) {
    auto kept = find_kept_job(job.output, waiting, head);
    if (!kept) return kept.error();
    kept_ = std::move(*kept);
    bytes_ = kept_.bytes;
  }
  if (kept_.finished) {
    remove_or_note(part_of(manifest_path));
    remove_waiting_layers(job);
    return {};
  }
  if (Status status = file_a_layer_ ? check_takes_layers(output()) : Status(); !status) return status;
  if (Status status = prepare_waiting_layers(job, !kept_.layers.empty()); !status) return status;
  if (one_file) {
    auto package = formats::Slice3mfWriter::make(head_);
    if (!package) return package.error();
    package_.emplace(std::move(*package));
  }
  ManifestWriter::ManifestOptions options{job.sync};
  if (file_a_layer_) {
    sync_ = FolderSync::of({waiting});
    options.sync_layers = [waiting] {
      const int reason = sync_folder(waiting);
      return reason == 0 ? Status() : Status(write_failure(waiting, reason));
    };
  }
  auto manifest = ManifestWriter::open(manifest_path, head, kept_.layers, options, std::move(*claim));
  if (!manifest) return manifest.error();
  manifest_.emplace(std::move(*manifest));
  return {};
}

/// One text file of all layers.
Status SliceFiles::open_single(const ManifestHead& head, Claim claim) {
  const Job& job = plan_.job;
  Buffer<char> start;
  encoder_->head(head_, start);
  auto file = LayeredFile::open({output(), job.output + "/manifest.json", job.resume, job.overwrite, job.sync}, head,
                                {start.data(), start.size()}, std::move(claim));
  if (!file) return file.error();
  remove_waiting_layers(job);  // of a run that was killed
  file_.emplace(std::move(*file));
  return {};
}

Status SliceFiles::keep() {
  waits_ = true;
  if (file_) return file_->keep();
  return manifest_ ? manifest_->flush() : Status();
}

Status SliceFiles::encode(const formats::SliceLayer& layer, Buffer<char>& text) const {
  text.clear();
  if (!encoder_) return {};
  if (Status status = encoder_->check(head_, layer); !status) return status;
  constexpr std::size_t kOfPoint = 22;  // bytes of its text, as a rule; growing by half would touch as much memory again
  reserve_more(text, layer.contours.point.size() * kOfPoint);
  if (file_a_layer_) {
    formats::encode_alone(*encoder_, head_, layer, text);
  } else {
    encoder_->layer(head_, layer, text);
  }
  return {};
}

Status SliceFiles::store(std::uint32_t index, const Buffer<char>& text, LayerRecord& record) const {
  if (!encoder_) return {};
  const auto bytes = std::as_bytes(std::span(text));
  record.bytes = bytes.size();
  record.hash = hash_bytes(bytes);
  if (!file_a_layer_) return {};
  const std::string path = waiting_layers(plan_.job) / fmt::format("{:06}{}", index, slice_extension(plan_.job));
  return write_file(path, bytes, layer_file_options(plan_.job));
}

Status SliceFiles::record(const formats::SliceLayer& layer, const Buffer<char>& text, LayerRecord& record) {
  if (file_) return file_->append({text.data(), text.size()}, record);
  if (package_) {
    if (Status status = package_->add(layer); !status) return status;
  }
  bytes_ += record.bytes;
  Status status = manifest_->append(record);
  return status && sync_ && plan_.job.sync == Sync::kJob ? sync_->wrote(record.bytes) : status;
}

namespace {

/// The job for lamina preview, which plans layers again, without settings that do not affect bytes.
Result<File> write_plan(const Job& job) {
  Job kept = job;
  kept.isa = Isa::kAuto;
  kept.threads = 0;
  kept.memory_bytes = Job().memory_bytes;
  kept.output.clear();
  kept.sync = Job().sync;
  return write_job(job.output + "/job.toml", kept, job.sync != Sync::kOff, "slice");
}

}  // namespace

Result<File> SliceFiles::write_package() {
  FileOptions how{.hash = true, .replace = plan_.job.overwrite || plan_.job.resume};
  if (plan_.job.sync == Sync::kOff) how.durable = Durable::kNo;
  return package_->write(output(), how);
}

// All that needs space is written before anything of an earlier job goes.
Result<std::uint64_t> SliceFiles::finish() {
  if (kept_.finished) return bytes_;
  if (file_ && file_->finished()) return file_->size();
  auto plan = write_plan(plan_.job);
  // Part names that a job file cannot hold are no error.
  if (!plan && plan.error().fault == Fault::kOutput) return plan.error();
  std::optional<File> package;
  if (package_) {
    auto written = write_package();
    if (!written) return written.error();
    package.emplace(std::move(*written));
  }
  const auto take_names = [&, earlier = earlier_slices(plan_.job)]() -> Status {
    Status status = replace_slices(plan_.job, earlier);
    for (File* file : {plan ? &*plan : nullptr, package ? &*package : nullptr}) {
      if (!status || file == nullptr) continue;
      const auto named = file->finish();
      if (!named) status = named.error();
    }
    return status && sync_ && plan_.job.sync != Sync::kOff ? sync_->sync() : status;
  };
  if (!file_) {
    const FileDigest digest = package ? package->digest() : FileDigest();
    bytes_ += digest.bytes;
    const Status status = manifest_->finish(digest, take_names);
    finished_ = status.ok();
    return status ? Result<std::uint64_t>(bytes_) : status.error();
  }
  Buffer<char> end;
  encoder_->tail(head_, end);
  return file_->finish({end.data(), end.size()}, take_names);
}

void SliceFiles::discard() {
  if (file_) file_->discard();
  if (manifest_) manifest_->discard();
  if (manifest_) remove_waiting_layers(plan_.job);
  made_.take_back();
}

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
  const std::string_view extension = formats::find_slice_format(job.slice.format)->extension;
  return extension.empty() ? ".cli" : extension;
}

std::string slice_file_name(const Job& job) {
  const std::string stem = fs::path(job.parts.front().path).stem().string();
  // part.stl.gz is part
  const std::string name =
      fs::path(stem).extension() == ".stl" || fs::path(stem).extension() == ".obj" ? fs::path(stem).stem().string() : stem;
  // Next to it are NAME.json and NAME.json.part.
  return fmt::format("{}{}", name.empty() ? "part" : short_name(name, 240 - slice_extension(job).size()), slice_extension(job));
}

Status check_slice_output(const Job& job) {
  if (const auto there = is_directory(job); !there || !*there) return there ? Status() : there.error();
  std::error_code error;
  if (Status busy = check_not_being_written(job.output + "/manifest.json"); !busy) return busy;
  const std::vector<ManifestFile> manifests = find_manifests(job.output);
  const OnRecord record = find_on_record(job.output);
  const bool replaces = job.overwrite || (job.resume && (record.finished || record.begun));
  if (!job.overwrite && !job.resume && !manifests.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: contains {}; {}, or name another directory", job.output,
                                            manifests.front().partial ? "an interrupted job" : "a job",
                                            manifests.front().partial ? "continue with --resume, start over with --overwrite"
                                                                      : "replace it with --overwrite")};
  }
  const bool knows_plan = job.overwrite || job.slice.file_a_layer || record.finished || record.all_made;
  for (const std::string& name : {std::string("job.toml"), slice_file_name(job)}) {
    const fs::path file = fs::path(job.output) / name;
    for (const PartRequest& part : job.parts) {
      if (same_file(file.string(), part.path)) {
        return Error{Fault::kUsage,
                     fmt::format("{}: is a part of the job and would be replaced; name another directory", file.string())};
      }
    }
    // Never replaces a user's job file: a job file of lamina has a manifest next to it.
    if (name == "job.toml" && fs::exists(file, error) && (!replaces || manifests.empty() || !knows_plan)) {
      return Error{Fault::kUsage,
                   fmt::format("{}: is there already, and the job would be kept in it; name another directory", file.string())};
    }
  }
  const bool requests = !job.overwrite && record.begun && job.slice.file_a_layer == record.finished;
  const auto known = [&](const fs::path& file) { return is_on_record(record, file.filename().string()); };
  if (replaces && (!requests || std::ranges::all_of(layer_files(job), known))) return {};
  if (!layer_files(job).empty()) {
    return Error{
        Fault::kUsage,
        fmt::format("{}/layers: contains layers; replace them with --overwrite, or name another directory", job.output)};
  }
  const fs::path file = fs::path(job.output) / slice_file_name(job);
  if (!job.slice.file_a_layer && fs::exists(file, error)) {
    return Error{Fault::kUsage,
                 fmt::format("{}: is there already; replace it with --overwrite, or name another directory", file.string())};
  }
  return {};
}

// Its name needs no random digits: the directory is claimed.
fs::path waiting_layers(const Job& job) { return waiting_folder(job, "layers"); }

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
    if (same_file(file.string(), part.path)) return std::nullopt;
  }
  return file;
}

}  // namespace

std::vector<fs::path> earlier_slices(const Job& job) {
  if (!job.overwrite && !job.resume) return {};
  std::vector<fs::path> earlier;
  if (auto other = other_slice_file(job)) earlier.push_back(std::move(*other));  // while its manifest still lists it
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
  if (error) note_left_behind(waiting_layers(job).string(), error.value());
}

}  // namespace lamina::pipeline
