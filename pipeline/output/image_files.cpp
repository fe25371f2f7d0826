#include "pipeline/output/image_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/job/file.h"
#include "pipeline/job/keys.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/manifest/compare.h"
#include "stages/geometry/bits.h"
#include "stages/geometry/drop_rows.h"
#include "stages/program/dialect.h"
#include "stages/support/io/file.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

/// A key's text as a job file has it.
std::string value_of(std::string_view section, std::string_view name, const Job& job) {
  for (const JobKey& key : job_keys()) {
    if (key.section == section && key.name == name) return key.write(job);
  }
  return {};
}

}  // namespace

ManifestHead image_head(const Plan& plan) {
  const Job& job = plan.job;
  ManifestHead head = plan_head(plan);
  head.format = job.format;
  head.extension = formats::extension_of(job.format).value_or("");
  head.fill_rule = value_of("image", "fill", job);
  head.mirror = value_of("image", "mirror", job);
  head.grid = plan.images->grid;
  if (plan.images->materials.several()) head.materials = plan.images->materials.used;
  head.max_drops = plan.images->dose.max_drops();
  head.geometry = plan.images->geometry;
  head.levels = job.levels;
  if (!plan.images->machine) return head;
  const Machine& machine = plan.images->machine->machine;
  head.machine = machine.name;
  head.dialect = machine.dialect;
  if (const auto* dialect = program::find_dialect(machine.dialect))
    head.program_extension = program_extension(*dialect, job.compress_programs);
  const std::string profile = pipeline::kept_machine_text(machine);
  head.machine_profile = hash_bytes(std::as_bytes(std::span(profile)));
  const ProgramFrame frame = program_frame(*plan.images->machine, plan.layer_count);
  head.head_drops = plan.images->machine->grid.head_drops;
  head.sweep_drops = plan.images->machine->grid.sweep_drops;
  head.program_start = hash_bytes(frame.start);
  head.program_end = hash_bytes(frame.end);
  return head;
}

formats::LayerTags tags_of(const Plan& plan, const Layer& layer) {
  constexpr std::string_view kAxes[] = {"", "x", "y", "xy"};
  const std::string_view axes = kAxes[static_cast<std::size_t>(plan.job.mirror)];
  // A job without a title is identified by its pixels alone: the same image is the same file in any job and position.
  const std::uint32_t layers = plan.job.title.empty() ? 0 : plan.layer_count;
  return {plan.job.title, {}, axes, layer.index, layers, layer.bottom, layer.bottom + layer.thickness};
}

ImageFiles::ImageFiles(const Plan& plan)
    : plan_(plan),
      head_(image_head(plan)),
      format_(formats::find_image_format(plan.job.format)),
      levels_(formats::find_level_format(plan.job.format)),
      in_container_(plan.job.container == Container::kZip && !plan.job.dry_run),
      in_pages_(plan.job.container == Container::kTiff && !plan.job.dry_run) {
  if (!plan.images->machine) return;
  program_.emplace(*plan.images->machine, plan.job.dry_run ? "" : plan.job.output, plan.layer_count,
                   layer_file_options(plan.job), plan.job.compress_programs);
  program_->in_memory = in_container_ || in_pages_;
}

Status ImageFiles::open() {
  const Job& job = plan_.job;
  if (in_container_ || in_pages_) {
    if (Status status = in_container_ ? open_container() : open_pages(); !status) return status;
    return plan_.undecided ? Status() : start();
  }
  if (Status status = check_shard_fits(job, head_); !status) return status;
  auto claim = prepare_output(job, made_);
  if (!claim) return claim.error();
  if (job.shard) sweep_partial_files(job.output, head_.first_layer, head_.last_layer);
  if (job.resume) {
    auto kept = layers_that_hold(job.output, job.output + "/" + manifest_name(job), head_);
    if (!kept) return kept.error();
    if (Status status = take_kept(std::move(*kept)); !status) return status;
  }
  if (!plan_.undecided && (!job.overwrite || job.shard)) {
    // Other shards have the other layers of the directory.
    const LayersOfJob own{&head_, job.shard ? 0 : head_.first_layer, job.shard ? head_.layer_count : head_.last_layer};
    if (Status status = check_no_strays(job.output, own, job.resume); !status) return status;
  }
  list_todo();
  if (program_) {
    if (Status status = program_->begin(); !status) return status;
  }
  claim_.emplace(std::move(*claim));
  return plan_.undecided ? Status() : start();
}

Status ImageFiles::take_kept(std::vector<LayerRecord> kept) {
  if (plan_.job.quote && plan_.scene->images.empty()) {
    if (Status status = check_shares_known(head_, kept); !status) return status;
  }
  kept_ = std::move(kept);
  for (LayerRecord& record : kept_) report_unfed(record);
  return {};
}

void ImageFiles::list_todo() {
  auto kept_record = kept_.begin();
  todo_.reserve(head_.last_layer - head_.first_layer - kept_.size());
  for (std::uint32_t index = head_.first_layer; index < head_.last_layer; ++index) {
    if (kept_record != kept_.end() && kept_record->layer.index == index) {
      ++kept_record;
    } else {
      todo_.push_back(index);
    }
  }
  while (next_kept_ < kept_.size() && (todo_.empty() || kept_[next_kept_].layer.index < todo_.front())) ++next_kept_;
}

Status ImageFiles::start() {
  const Job& job = plan_.job;
  head_.layer_count = plan_.layer_count;
  head_.first_layer = plan_.range[0];
  head_.last_layer = plan_.range[1];
  if (in_container_) return start_container();
  if (in_pages_) return start_pages();
  std::vector<std::string> folders{job.output + "/layers"};
  if (program_) folders.push_back(job.output + "/program");
  sync_ = FolderSync::of(folders);
  const auto sync_names = [folders] {
    for (const std::string& folder : folders) {
      if (const int reason = sync_folder(folder); reason != 0) return Status(write_failure(folder, reason));
    }
    return Status();
  };
  // A new job's record reaches the disk together with the first layers; no step waits for it.
  const bool at_once = job.sync != Sync::kJob || !kept_.empty();
  auto manifest = ManifestWriter::open(job.output + "/" + manifest_name(job), head_,
                                       {kept_.begin(), kept_.begin() + static_cast<std::ptrdiff_t>(next_kept_)},
                                       {job.sync, at_once, sync_names}, std::move(*claim_));
  if (!manifest) return manifest.error();
  manifest_.emplace(std::move(*manifest));
  claim_.reset();
  return at_once ? Status() : sync_->begin();
}

std::uint64_t ImageFiles::FileWork::bytes() const {
  std::uint64_t total = bytes_held(file) + program.bytes() + levels.bytes();
  for (const formats::Bytes& one : files) total += bytes_held(one);
  return total;
}

Status ImageFiles::encode(const LayerImages& images, FileWork& work, LayerRecord& record) const {
  formats::LayerTags tags = tags_of(plan_, record.layer);
  if (levels_ == nullptr) {
    if (!work.encoder) (work.encoder = format_->make_encoder())->use(plan_.job.isa);
    work.encoder->tag(tags);
  } else {
    if (!work.level_encoder) work.level_encoder = levels_->make_encoder();
    work.level_encoder->tag(tags);
  }
  if (head_.named_images() == 0) {
    if (Status status = encode_one(images, 0, work, record, work.file); !status) return status;
    record.bytes = work.file.size();
    record.hash = hash_bytes(work.file);
    return {};
  }
  work.files.resize(head_.named_images());
  for (std::size_t m = 0; m < work.files.size(); ++m) {
    if (!head_.materials.empty()) tags.material = head_.materials[m / head_.drop_images()].name;
    if (work.encoder) work.encoder->tag(tags);
    if (work.level_encoder) work.level_encoder->tag(tags);
    if (Status status = encode_one(images, m, work, record, work.files[m]); !status) return status;
    record.images[m].bytes = work.files[m].size();
    record.images[m].hash = hash_bytes(work.files[m]);
    record.bytes += work.files[m].size();
  }
  return {};
}

Status ImageFiles::encode_one(const LayerImages& images, std::size_t number, FileWork& work, const LayerRecord& record,
                              formats::Bytes& file) const {
  file.clear();
  if (head_.extension.empty()) return {};
  const double x = head_.grid.x.dpi(), y = head_.grid.y.dpi();
  const bool several = !head_.materials.empty();
  const std::size_t material = number / head_.drop_images();
  Status status;
  if (levels_ != nullptr) {
    if (!images.drops.empty()) levels_of(images.drops[several ? 1 + material : 0], work.levels);
    status = work.level_encoder->encode(images.drops.empty() ? images.shares : work.levels, head_.full_level(), x, y, file);
  } else if (images.bits != nullptr) {
    status = work.encoder->encode(*images.bits, x, y, file);
  } else if (images.drops.empty() || head_.geometry) {
    status = work.encoder->encode(several ? images.material[material] : images.whole, x, y, file);
  } else {
    const auto drop = static_cast<std::uint32_t>(number % head_.drop_images());
    status = work.encoder->encode(DropPlane(images.drops[several ? 1 + material : 0], drop), x, y, file);
  }
  if (status) return {};
  return Error{status.error().fault, fmt::format("layer {}: {}", record.layer.index, status.error().message)};
}

Status ImageFiles::store(const LayerImages& images, FileWork& work, LayerRecord& record) const {
  if (in_pages_) return program(images, work, record);
  if (in_container_) {
    if (Status status = program(images, work, record); !status) return status;
    work.sums.clear();
    return for_each_file(record, work, [&](const std::string&, std::span<const std::byte> bytes) {
      work.sums.push_back(formats::crc_of(bytes));
      return Status();
    });
  }
  const auto files = layer_images(head_, record);
  const FileOptions how = layer_file_options(plan_.job);
  for (std::size_t m = 0; m < files.size() && !files[m].name.empty(); ++m) {
    const formats::Bytes& file = head_.named_images() == 0 ? work.file : work.files[m];
    if (Status status = write_file(plan_.job.output + "/" + files[m].name, file, how); !status) return status;
  }
  return program(images, work, record);
}

Result<std::vector<std::uint32_t>> ImageFiles::feeds_of(const LayerRecord& record) const {
  std::vector<std::uint64_t> pixels{record.set_pixels};
  if (!head_.materials.empty()) pixels = record.pixels_of_materials(head_.materials.size());
  return vats_of_layer(plan_.images->machine->machine, plan_.images->materials, pixels);
}

void ImageFiles::report_unfed(LayerRecord& record) const {
  if (!program_ || head_.materials.empty()) return;
  const auto feeds = feeds_of(record);
  for (std::size_t i = 0; feeds && i < record.images.size(); ++i) {
    const JobMaterial& material = head_.materials[i / head_.drop_images()];
    record.images[i].unfed_pixels = unfed_pixels(material, *feeds, record.images[i].set_pixels);
  }
}

Status ImageFiles::program(const LayerImages& images, FileWork& work, LayerRecord& record) const {
  return program(images, work, record, false);
}

Status ImageFiles::measure(const LayerImages& images, FileWork& work, LayerRecord& record) const {
  const Status status = encode(images, work, record);
  return status ? program(images, work, record, true) : status;
}

Status ImageFiles::program(const LayerImages& images, FileWork& work, LayerRecord& record, bool measures) const {
  if (!program_) return {};
  const auto feeds = feeds_of(record);
  if (!feeds) {
    return Error{feeds.error().fault, fmt::format("layer {} (z {:.3f} mm): {}", record.layer.index, mm(record.layer.plane()),
                                                  feeds.error().message)};
  }
  report_unfed(record);
  if (!images.drops.empty()) {
    const PrintProgram::Drops drops{images.drops[0], std::max(1u, head_.max_drops)};
    return program_->write_layer(record.layer, drops, *feeds, work.program, record.program, measures);
  }
  if (images.bits == nullptr)
    return program_->write_layer(record.layer, images.whole, *feeds, work.program, record.program, measures);
  RunsBuilder builder(images.bits->columns());
  RowRuns rows(*images.bits);
  for (std::uint32_t r = 0; r < rows.rows(); ++r) builder.add_changes(rows.row(r));
  const Runs runs = builder.finish();
  return program_->write_layer(record.layer, runs, *feeds, work.program, record.program, measures);
}

std::uint64_t ImageFiles::bytes_bound(const dose::DropBound& drops, std::uint64_t edges) const {
  const std::uint64_t files = std::max<std::size_t>(1, head_.named_images());
  const std::uint32_t planes = std::max(1u, head_.max_drops);
  const auto max_bytes = levels_ == nullptr ? format_->max_bytes : levels_->max_bytes;
  // Planes of drops share their changes, images of materials each have all.
  const std::uint64_t of_plane = drops.changes_of_all / planes + 1;
  const bool one = head_.materials.empty() && levels_ == nullptr;
  const std::uint64_t of_file = head_.geometry ? edges : one ? of_plane : drops.changes;
  std::uint64_t total = files * max_bytes(head_.grid.columns(), head_.grid.rows(), of_file);
  // Drops as levels, to be encoded.
  if (drops.runs > 0 && levels_ != nullptr) total += 18 * drops.changes + 8 * std::uint64_t{head_.grid.rows()};
  return total + (program_ ? program_->bytes_bound(drops.runs > 0 ? 2 * drops.runs : drops.changes, planes) : 0);
}

Status ImageFiles::record_kept_below(std::uint32_t layer) {
  for (; next_kept_ < kept_.size() && kept_[next_kept_].layer.index < layer; ++next_kept_) {
    if (Status status = manifest_->append(kept_[next_kept_]); !status) return status;
  }
  return {};
}

Status ImageFiles::record(const LayerRecord& record, const FileWork& work) {
  if (Status status = record_kept_below(record.layer.index); !status) return status;
  if (in_container_) {
    auto sum = work.sums.begin();
    Status status = for_each_file(record, work, [&](const std::string& name, std::span<const std::byte> bytes) {
      return container_->add(name, bytes, *sum++);
    });
    if (status) status = container_->flush(plan_.job.sync == Sync::kLayer);
    return status ? manifest_->append(record) : status;
  }
  if (in_pages_) {
    std::vector<StoredFile> files;
    Status status = for_each_file(record, work, [&](const std::string& name, std::span<const std::byte> bytes) {
      files.push_back({name, bytes});
      return Status();
    });
    if (status) status = pages_->add(files, plan_.job.sync == Sync::kLayer);
    return status ? manifest_->append(record) : status;
  }
  Status status = manifest_->append(record);
  return status && plan_.job.sync == Sync::kJob ? sync_->wrote(record.bytes + record.program.stored) : status;
}

Status ImageFiles::finish() {
  if (finished_) return {};
  if (Status status = record_kept_below(UINT32_MAX); !status) return status;
  if (in_container_) return finish_container();
  if (in_pages_) return manifest_->finish({}, [this] { return pages_->finish(program_ ? &*program_ : nullptr); });
  // Once for layers and manifest: each wait for the disk takes some milliseconds.
  return manifest_->finish({}, [this] { return plan_.job.sync == Sync::kOff ? Status() : sync_->sync(); });
}

template <class Visit>
Status ImageFiles::for_each_file(const LayerRecord& record, const FileWork& work, const Visit& visit) const {
  const auto images = layer_images(head_, record);
  for (std::size_t m = 0; m < images.size() && !images[m].name.empty(); ++m) {
    const formats::Bytes& file = head_.named_images() == 0 ? work.file : work.files[m];
    if (Status status = visit(images[m].name, std::as_bytes(std::span(file))); !status) return status;
  }
  return program_ ? visit(program_file_name(record.layer.index, head_.program_extension), work.program.file.stored())
                  : Status();
}

Status ImageFiles::open_container() {
  const Job& job = plan_.job;
  auto claim = claim_container(job, made_);
  if (!claim) return claim.error();
  if (job.resume) {
    auto kept = find_kept_container(job, head_);
    if (!kept) return kept.error();
    kept_container_ = std::move(*kept);
    finished_ = kept_container_.finished;
    if (Status status = take_kept(kept_container_.layers); !status) return status;
  }
  list_todo();
  claim_.emplace(std::move(*claim));
  return {};
}

Status ImageFiles::start_container() {
  const Job& job = plan_.job;
  if (finished_) {  // a run that was killed at its very end may have left its begun manifest
    remove_or_note(part_of(container_manifest(job)));
    return {};
  }
  auto container = JobContainer::open(job, kept_container_);
  if (!container) return container.error();
  container_.emplace(std::move(*container));
  if (program_ && kept_container_.entries.empty()) {
    const Status status = program_->give_start(
        [&](const std::string& name, std::span<const std::byte> bytes) { return container_->add(name, bytes); });
    if (!status) return status;
  }
  const bool at_once = job.sync != Sync::kJob || !kept_.empty();
  auto manifest = ManifestWriter::open(container_manifest(job), head_, kept_, {job.sync, at_once, {}}, std::move(*claim_));
  if (!manifest) return manifest.error();
  manifest_.emplace(std::move(*manifest));
  claim_.reset();
  return {};
}

Status ImageFiles::finish_container() {
  return manifest_->finish_elsewhere([&]() -> Status {
    Status status;
    if (program_) {
      status = program_->give_end(
          [&](const std::string& name, std::span<const std::byte> bytes) { return container_->add(name, bytes); });
    }
    const std::string manifest = part_of(container_manifest(plan_.job));
    return status ? container_->finish(inspection_, manifest_name(plan_.job), manifest) : status;
  });
}

bool ImageFiles::needs_big_pages() const {
  // Group 4 (ITU-T T.6) takes at most 7 bits a pixel, PackBits and deflate an eighth more than the pixels.
  const std::uint64_t pixels = std::uint64_t{head_.grid.columns()} * head_.grid.rows();
  const std::uint64_t of_image = pixels / 8 * (levels_ == nullptr ? 7 : 9) + 16 * std::uint64_t{head_.grid.rows()} + 4096;
  const std::uint64_t of_program = program_ ? program_->file_bound(std::max(1u, head_.max_drops)) : 0;
  const std::uint64_t layers = plan_.range[1] - plan_.range[0] + 1;
  return layers * std::max(of_image * std::max<std::size_t>(1, head_.named_images()), of_program) > UINT32_MAX;
}

Status ImageFiles::open_pages() {
  auto claim = claim_paged_output(plan_.job, made_);
  if (!claim) return claim.error();
  if (plan_.job.resume) {
    auto kept = find_kept_pages(plan_.job, head_, needs_big_pages());
    if (!kept) return kept.error();
    kept_pages_ = std::move(*kept);
    finished_ = kept_pages_.finished;
    if (Status status = take_kept(kept_pages_.layers); !status) return status;
  }
  list_todo();
  claim_.emplace(std::move(*claim));
  return {};
}

Status ImageFiles::start_pages() {
  const Job& job = plan_.job;
  if (finished_) return {};
  const bool at_once = job.sync != Sync::kJob || !kept_.empty();
  auto manifest =
      ManifestWriter::open(job.output + "/" + manifest_name(job), head_, kept_, {job.sync, at_once, {}}, std::move(*claim_));
  if (!manifest) return manifest.error();
  manifest_.emplace(std::move(*manifest));
  claim_.reset();
  auto pages = PagedJob::open(job, head_, needs_big_pages(), kept_pages_, program_ ? &*program_ : nullptr);
  if (!pages) {
    if (kept_.empty()) manifest_->discard();  // else the record of the layers that --resume continues
    return pages.error();
  }
  pages_.emplace(std::move(*pages));
  return {};
}

Status ImageFiles::keep() { return manifest_ ? manifest_->flush() : Status(); }

void ImageFiles::discard() {
  if (manifest_) manifest_->discard();
  if (container_) container_->discard();
  if (pages_) pages_->discard();
  if (in_container_) return made_.take_back();
  if (!remove_layers(plan_.job.output)) return;
  for (const char* folder : {"layers", "program"}) {
    const std::filesystem::path path = std::filesystem::path(plan_.job.output) / folder;
    std::error_code ignored;
    if (!std::filesystem::is_symlink(path, ignored)) std::filesystem::remove(path, ignored);  // fails if other files remain
  }
  made_.take_back();
}

}  // namespace lamina::pipeline
