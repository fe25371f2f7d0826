#include "pipeline/output/slice_files.h"

#include <fmt/format.h>

#include <filesystem>

#include "pipeline/job/file.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/plan_head.h"
#include "pipeline/output/slice_directory.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_target.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {

namespace fs = std::filesystem;

SliceFiles::SliceFiles(const Plan& plan)
    : plan_(plan), format_(*write::find_slice_format(plan.job.slice.format)), file_a_layer_(plan.job.slice.file_a_layer) {
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
    write::remove_or_note(write::part_of(manifest_path));
    remove_waiting_layers(job);
    return {};
  }
  if (Status status = file_a_layer_ ? check_takes_layers(output()) : Status(); !status) return status;
  if (Status status = prepare_waiting_layers(job, !kept_.layers.empty()); !status) return status;
  if (one_file) {
    auto package = write::Slice3mfWriter::make(head_);
    if (!package) return package.error();
    package_.emplace(std::move(*package));
  }
  ManifestWriter::Options options{job.sync};
  if (file_a_layer_) {
    sync_ = write::FolderSync::of({waiting});
    options.sync_layers = [waiting] {
      const int reason = write::sync_folder(waiting);
      return reason == 0 ? Status() : Status(write::write_failure(waiting, reason));
    };
  }
  auto manifest = ManifestWriter::open(manifest_path, head, kept_.layers, options, std::move(*claim));
  if (!manifest) return manifest.error();
  manifest_.emplace(std::move(*manifest));
  return {};
}

/// One text file of all layers.
Status SliceFiles::open_single(const ManifestHead& head, write::Claim claim) {
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

Status SliceFiles::encode(const write::SliceLayer& layer, Buffer<char>& text) const {
  text.clear();
  if (!encoder_) return {};
  if (Status status = encoder_->check(head_, layer); !status) return status;
  if (file_a_layer_) {
    write::encode_alone(*encoder_, head_, layer, text);
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
  return write::write_file(path, bytes, layer_file_options(plan_.job));
}

Status SliceFiles::record(const write::SliceLayer& layer, const Buffer<char>& text, LayerRecord& record) {
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
Result<write::File> write_plan(const Job& job) {
  Job kept = job;
  kept.isa = Isa::kAuto;
  kept.threads = 0;
  kept.memory_bytes = Job().memory_bytes;
  kept.output.clear();
  kept.sync = Job().sync;
  return write_job(job.output + "/job.toml", kept, job.sync != Sync::kOff, "slice");
}

}  // namespace

Result<write::File> SliceFiles::write_package() {
  write::FileOptions how{.hash = true, .replace = plan_.job.overwrite || plan_.job.resume};
  if (plan_.job.sync == Sync::kOff) how.durable = write::Durable::kNo;
  return package_->write(output(), how);
}

// All that needs space is written before anything of an earlier job goes.
Result<std::uint64_t> SliceFiles::finish() {
  if (kept_.finished) return bytes_;
  if (file_ && file_->finished()) return file_->size();
  auto plan = write_plan(plan_.job);
  // Part names that a job file cannot hold are no error.
  if (!plan && plan.error().fault == Fault::kOutput) return plan.error();
  std::optional<write::File> package;
  if (package_) {
    auto written = write_package();
    if (!written) return written.error();
    package.emplace(std::move(*written));
  }
  const auto take_names = [&, earlier = earlier_slices(plan_.job)]() -> Status {
    Status status = replace_slices(plan_.job, earlier);
    for (write::File* file : {plan ? &*plan : nullptr, package ? &*package : nullptr}) {
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

}  // namespace lamina::pipeline
