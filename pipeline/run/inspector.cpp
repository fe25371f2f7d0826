#include "pipeline/run/inspector.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "pipeline/flow/layers.h"
#include "pipeline/manifest/inspection_file.h"
#include "pipeline/output/directory.h"
#include "pipeline/report/image_text.h"
#include "stages/geometry/combine.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// That of the powder, or 0.3 mm; at least two pixels, because thinner walls are not resolved.
double narrowest_mm(const ImagePlan& images) {
  constexpr double kUnstated = 0.3;
  const double stated = images.machine ? images.machine->machine.powder.min_wall_mm : 0;
  return std::max(2 * 25.4 / std::min(images.grid.x.dpi(), images.grid.y.dpi()), stated > 0 ? stated : kUnstated);
}

/// Ten grains of 80 um. Grains form arches over openings below about five of their diameters: I. Zuriguel, "Clogging of
/// granular materials in bottlenecks", Papers in Physics 6, 060014, 2014.
constexpr double kMinDrainMm = 0.8;

std::vector<checks::Solid> placed_parts(const Plan& plan) {
  std::vector<checks::Solid> placed;
  for (std::size_t i = 0; i < plan.scene->instances.size(); ++i) {
    placed.push_back({box_of(*plan.scene, plan.scene->instances[i]), plan.scene->part_of_instance[i]});
  }
  for (const PlacedImages& images : plan.scene->images) {
    placed.push_back({plan.scene->parts[images.part].bounds, images.part});
    Box& box = placed.back().box;
    const PixelGrid& grid = plan.images->grid;
    const auto nm = [](std::int64_t pixel, const PixelAxis& axis) { return static_cast<Nm>(pixel * axis.span / axis.dots); };
    const std::int64_t back = std::int64_t{grid.rows()} - images.position.first_row;
    box.lo = {nm(images.position.column.front(), grid.x), nm(back - std::ssize(images.position.row), grid.y), images.bottom};
    box.hi = {nm(images.position.column.back(), grid.x), nm(back, grid.y),
              static_cast<Nm>(images.bottom + std::int64_t{images.thickness} * images.images->layers())};
  }
  return placed;
}

/// Begins an inspection.
void start(const PixelGrid& grid, const SectionsHead& head, std::optional<checks::Inspection>& inspection) {
  inspection.emplace(grid, head.placed, nm_of(head.min_mm), nm_of(head.drain_mm), head.max_bytes);
}

Json facts_of(const checks::Inspection& inspection, const SectionsHead& head, const std::vector<Warning>& warnings) {
  return {{"inspection", json_of(inspection.findings(), head.min_mm, head.drain_mm)}, {"warnings", warnings_json(warnings)}};
}

void end_inspection(checks::Inspection& inspection, const SectionsHead& head, std::vector<Warning>& warnings) {
  checks::report(inspection.finish(), head.parts, head.min_mm, head.drain_mm, warnings);
}

/// Where two runs inspect differently; "" if they do not.
std::string_view difference(const SectionsHead& one, const SectionsHead& other) {
  const auto boxes = [](const checks::Solid& a, const checks::Solid& b) {
    return a.box.lo == b.box.lo && a.box.hi == b.box.hi && a.part == b.part;
  };
  if (one.min_mm != other.min_mm) return "--min-wall differs";
  if (one.drain_mm != other.drain_mm) return "--min-drain differs";
  if (one.max_bytes != other.max_bytes) return "--memory differs";
  return std::ranges::equal(one.placed, other.placed, boxes) ? "" : "positions differ";
}

/// An inspection of sections that come one by one.
class SectionQueue {
 public:
  /// grid  outlives it. job  id of its manifest
  SectionQueue(const PixelGrid& grid, std::string job) : grid_(grid), job_(std::move(job)) {}

  Status begin(const KeptLayers& of, SectionsHead head) {
    layers_ = of.layers;
    const std::string path = sections_path(of.manifest);
    if (job_ != head.job) return Error{Fault::kVerification, path + ": belongs to another job"};
    if (inspection_) {
      const std::string_view what = difference(head_, head);
      return what.empty() ? Status() : Status(Error{Fault::kVerification, fmt::format("{}: {} from other shards", path, what)});
    }
    head_ = std::move(head);
    start(grid_, head_, inspection_);
    return {};
  }
  Status add(Section section) {
    if (waiting_.size() >= layers_.size()) return Error{Fault::kVerification, "more sections than layers"};
    bytes_ += inspection_->bytes_needed(section.image);
    waiting_.push_back(std::move(section));
    if (waiting_.size() >= layers_in_flight() || bytes_ > head_.max_bytes) flush();
    return {};
  }
  /// Whether all layers came.
  bool end() {
    flush();
    return layers_.empty();
  }
  std::optional<checks::Inspection>& inspection() { return inspection_; }
  const SectionsHead& head() const { return head_; }

 private:
  void flush() {
    std::vector<checks::LayerInspection> measured(waiting_.size());
    tbb::parallel_for(std::size_t{0}, waiting_.size(), [&](std::size_t i) {
      inspection_->prepare(waiting_[i].image, measured[i]);
      if (waiting_[i].has_samples) inspection_->add_sample(waiting_[i].sampled, measured[i]);
    });
    for (std::size_t i = 0; i < measured.size(); ++i) inspection_->add(layers_[i].layer, measured[i]);
    layers_ = layers_.subspan(measured.size());
    waiting_.clear();
    bytes_ = 0;
  }

  const PixelGrid& grid_;
  std::string job_;
  SectionsHead head_;
  std::optional<checks::Inspection> inspection_;
  std::span<const LayerRecord> layers_;  // that are to be inspected, of the run at hand
  std::vector<Section> waiting_;
  std::uint64_t bytes_ = 0;
};

}  // namespace

Inspector::Inspector(const Plan& plan) : plan_(plan) {
  if (!on()) return;
  head_ = {{},
           plan.job.min_wall_mm.value_or(narrowest_mm(*plan.images)),
           plan.job.min_drain_mm.value_or(kMinDrainMm),
           plan.job.memory_bytes / 2,
           {},
           placed_parts(plan)};
  for (const PartSummary& part : plan.scene->parts) head_.parts.push_back(one_line(part.path));
  if (!keeps()) start(plan.images->grid, head_, inspection_);
}

std::uint64_t Inspector::bytes_needed(const RunsView& image) const {
  return inspection_ ? inspection_->bytes_needed(image) : 4 * image.change.size_bytes() + 2 * image.row_offset.size_bytes();
}

void Inspector::prepare(const RunsView& image, SectionWork& work) const {
  if (inspection_) return inspection_->prepare(image, work.measured);
  work.kept.clear();
  work.sampled.row_offset.clear();
  add_image(image, work.kept);
}

void Inspector::add_sample(const RunsView& sample, SectionWork& work) const {
  if (inspection_) return inspection_->add_sample(sample, work.measured);
  if (work.sampled.row_offset.empty()) {
    checks::copy_rows(sample, 0, sample.rows(), work.sampled);
  } else {
    combine(work.sampled, sample, SetOperation::kIntersection, work.both);
    std::swap(work.sampled, work.both);
  }
}

void Inspector::end(SectionWork& work) const {
  if (!inspection_ && !work.sampled.row_offset.empty()) add_image(work.sampled, work.kept);
}

Status Inspector::record(const Layer& layer, const SectionWork& work) {
  if (sections_) return append_block(work.kept, *sections_);
  inspection_->add(layer, work.measured);
  return {};
}

void Inspector::warn(const Summary&, std::vector<Warning>& warnings) {
  if (!inspection_) return;
  end_inspection(*inspection_, head_, reports_);
  warnings.insert(warnings.end(), reports_.begin(), reports_.end());
}

void Inspector::report(Summary& summary) const {
  if (keeps()) {
    summary.results.emplace_back("inspected", "not yet: lamina merge inspects all layers; --dry-run inspects these alone");
    summary.facts["inspection"] = {{"layers", 0}, {"min_wall_mm", head_.min_mm}, {"min_drain_mm", head_.drain_mm}};
  } else if (on()) {
    summary.facts["inspection"] = json_of(inspection_->findings(), head_.min_mm, head_.drain_mm);
  }
}

Status Inspector::check_file() const { return on() && whole() ? check_inspection_file(plan_.job.output) : Status(); }

Status Inspector::open(const ManifestHead& head) {
  const std::string manifest = plan_.job.output + "/" + manifest_name(plan_.job);
  if (!keeps()) {
    if (whole() || !plan_.job.resume) remove_sections(manifest);
    return {};
  }
  head_.job = hex(head.id());
  FileOptions options{.follow = false};
  if (plan_.job.sync == Sync::kOff) options.durable = Durable::kNo;
  return open_sections(sections_path(manifest), head_, options, sections_.emplace());
}

Status Inspector::finish() {
  if (!sections_) return {};
  const auto digest = sections_->finish();
  return digest ? Status() : Status(digest.error());
}

Status Inspector::write(const ManifestHead& head) const {
  if (!on() || !whole()) return keep_inspection_of(plan_.job.output, head);
  return write_inspection(plan_.job.output, head, facts_of(*inspection_, head_, reports_));
}

std::string Inspector::text(const ManifestHead& head) const {
  return inspection_text(head, facts_of(*inspection_, head_, reports_));
}

bool Inspector::whole() const { return plan_.range[0] == 0 && plan_.range[1] == plan_.layer_count && !plan_.job.shard; }

WholeInspection inspect_kept(const ManifestHead& job, std::span<const KeptLayers> kept) {
  WholeInspection result;
  const auto has_file = [](const KeptLayers& of) { return is_file(sections_path(of.manifest)); };
  if (std::ranges::none_of(kept, has_file)) return result;
  SectionQueue queue(job.grid, hex(job.id()));
  for (const KeptLayers& of : kept) {
    if (of.layers.empty()) continue;
    const std::string path = sections_path(of.manifest);
    Status status = read_sections(
        path, job.grid, [&](SectionsHead head) { return queue.begin(of, std::move(head)); },
        [&](Section section) { return queue.add(std::move(section)); });
    if (status && !queue.end()) status = Error{Fault::kVerification, path + ": is damaged"};
    if (status) continue;
    result.warnings.push_back(
        {"not-inspected", fmt::format("the layers were not inspected: {}; run that shard again with --resume "
                                      "--inspect, then merge again",
                                      status.error().message)});
    return result;
  }
  if (!queue.inspection()) return result;
  end_inspection(*queue.inspection(), queue.head(), result.warnings);
  result.facts = facts_of(*queue.inspection(), queue.head(), result.warnings);
  return result;
}

}  // namespace lamina::pipeline
