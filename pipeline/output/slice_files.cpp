#include "pipeline/output/slice_files.h"

#include <fmt/format.h>

#include <filesystem>

#include "pipeline/job/file.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/plan_head.h"
#include "pipeline/output/slice_directory.h"
#include "stages/data/text/version.h"
#include "stages/write/file.h"
#include "stages/write/file_target.h"
#include "stages/write/manifest/kept.h"

namespace lamina::pipeline {

namespace fs = std::filesystem;

SliceFiles::SliceFiles(const Plan& plan) : plan_(plan), file_a_layer_(plan.job.slice.file_a_layer) {
  const SliceRequest& slice = plan.job.slice;
  head_.parts = plan.sections->names();
  head_.bounds = plan.sections->bounds();
  head_.layers = plan.range[1] - plan.range[0];
  head_.first_bottom = head_.layers > 0 ? plan.layer(plan.range[0]).bottom : 0;
  head_.program = fmt::format("lamina {}", version());
  if (slice.format == "svg") encoder_ = write::make_svg_encoder();
  if (slice.format.starts_with("cli")) {
    write::SliceFormatOptions options;
    options.empty_first_layer = slice.empty_first_layer;
    encoder_ = write::make_cli_encoder(slice.format == "cli-binary", options);
  }
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
  auto claim = prepare_slice_directory(job);
  if (!claim) return claim.error();
  ManifestHead head = plan_head(plan_);
  head.format = job.slice.format;
  const bool one_file = job.slice.format != "null" && !file_a_layer_;
  if (file_a_layer_ && encoder_) head.extension = slice_extension(job);
  if (one_file) head.file = slice_file_name(job);
  const std::string manifest_path = job.output + "/manifest.json";
  if (one_file && encoder_) {
    Buffer<char> start;
    encoder_->head(head_, start);
    auto file = LayeredFile::open({output(), manifest_path, job.resume, job.overwrite, job.sync}, head,
                                  {start.data(), start.size()}, std::move(*claim));
    if (!file) return file.error();
    file_.emplace(std::move(*file));
    return {};
  }
  if (one_file) {
    auto package = write::Slice3mfWriter::make(head_);
    if (!package) return package.error();
    package_.emplace(std::move(*package));
  }
  ManifestWriter::Options options{job.sync};
  if (file_a_layer_) {
    if (Status status = find_kept(head); !status) return status;
    const std::string waiting = waiting_layers(job).string();
    sync_ = write::FolderSync::of({waiting});
    options.sync_layers = [waiting] {
      const int reason = write::sync_folder(waiting);
      return reason == 0 ? Status() : Status(write::write_failure(waiting, reason));
    };
  }
  auto manifest = ManifestWriter::open(manifest_path, head, kept_, options, std::move(*claim));
  if (!manifest) return manifest.error();
  manifest_.emplace(std::move(*manifest));
  return {};
}

/// Files a layer wait beside the begun manifest until all are there.
Status SliceFiles::find_kept(const ManifestHead& head) {
  const std::string begun = write::part_of(plan_.job.output + "/manifest.json");
  if (!plan_.job.resume || !has_manifest_head(begun)) return {};
  const auto earlier = read_manifest(begun);
  if (!earlier) return earlier.error();
  if (Status status = check_same_job(begun, *earlier, head); !status) return status;
  kept_ = records_with_files(waiting_layers(plan_.job).string(), *earlier);
  for (const LayerRecord& record : kept_) bytes_ += record.bytes;
  return {};
}

Status SliceFiles::keep() {
  waits_ = true;
  return file_ ? file_->keep() : manifest_->flush();
}

Sections::TextBytes SliceFiles::text_bytes() const {
  // Two numbers of about 11 characters and separators. An SVG element has kind, colour and width, a CLI element part and
  // count; both repeat the last point of the previous element.
  if (!encoder_) return {};
  if (plan_.job.slice.format == "svg") return {26, 200, 0};
  if (plan_.job.slice.format == "cli-binary") return {16, 24, 0};
  return {48, 64, 0};
}

void SliceFiles::encode(const write::SliceLayer& layer, Buffer<char>& text) const {
  text.clear();
  if (!encoder_) return;
  if (file_a_layer_) {
    write::encode_alone(*encoder_, head_, layer, text);
  } else {
    encoder_->layer(head_, layer, text);
  }
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
  return manifest_->append(record);
}

/// Saves the job for lamina preview, which plans layers again, without settings that do not affect bytes. Part names that
/// a job file cannot hold are not an error.
Status SliceFiles::save_plan() const {
  Job kept = plan_.job;
  kept.threads = 0;
  kept.memory_bytes = Job().memory_bytes;
  kept.output.clear();
  kept.sync = Job().sync;
  const Status status = save_job(plan_.job.output + "/job.toml", kept, plan_.job.sync != Sync::kOff);
  return !status && status.error().fault == Fault::kOutput ? status : Status();
}

Result<FileDigest> SliceFiles::finish_package() {
  write::FileOptions how{.replace = plan_.job.overwrite || plan_.job.resume};
  if (plan_.job.sync == Sync::kOff) how.durable = write::Durable::kNo;
  if (Status status = package_->finish(output(), how); !status) return status.error();
  const auto digest = digest_file(output());
  if (!digest) return Error{Fault::kOutput, digest.error().message};
  return digest;
}

Result<std::uint64_t> SliceFiles::finish() {
  if (file_ && file_->finished()) return file_->size();
  FileDigest package;
  if (package_) {
    auto digest = finish_package();
    if (!digest) return digest.error();
    package = *digest;
    bytes_ = package.bytes;
  }
  if (Status status = replace_earlier_slices(plan_.job); !status) return status.error();
  if (Status status = save_plan(); !status) return status.error();
  finished_ = true;
  if (!file_) {
    if (sync_ && plan_.job.sync != Sync::kOff) {
      if (Status status = sync_->sync(); !status) return status.error();
    }
    if (Status status = manifest_->finish(package); !status) return status.error();
    return bytes_;
  }
  Buffer<char> end;
  encoder_->tail(head_, end);
  return file_->finish({end.data(), end.size()});
}

void SliceFiles::discard() {
  if (file_) file_->discard();
  if (manifest_) manifest_->discard();
}

}  // namespace lamina::pipeline
