#include "pipeline/show/report_warnings.h"

#include <algorithm>
#include <utility>

#include "pipeline/plan/dose.h"
#include "pipeline/plan/layers.h"
#include "pipeline/run/job_checks.h"
#include "stages/checks/layer_warnings.h"
#include "stages/checks/solid_checks.h"
#include "stages/heights/heights.h"
#include "stages/program/head_grid.h"

namespace lamina::pipeline {
namespace {

bool any_bleed(const Job& job, bool (*is)(double)) {
  return std::ranges::any_of(bleeds_of(job), [&](const auto& um) { return std::ranges::any_of(um, is); });
}

}  // namespace

std::unique_ptr<ReportBleed> ReportBleed::make(const Manifest& manifest, const Job& job, const Machine* machine,
                                               const Scene& scene) {
  const auto inwards = [](const auto& um) { return std::max(um[0], um[1]) > 0; };
  auto materials = materials_of(job, machine);
  if (fills(job) || !materials || std::ranges::none_of(bleeds_of(job), inwards)) return nullptr;
  const PixelGrid& grid = manifest.head.grid;
  std::unique_ptr<ReportBleed> report(new ReportBleed());
  report->plan_.job = job;
  report->plan_.job.engine = Engine::kRays;
  report->plan_.scene = std::make_unique<Scene>(scene);
  DosePlan dose(job, grid);
  auto solids = Solids::build(*report->plan_.scene, report->plan_.job, grid, *materials, dose.zones());
  if (!solids) return nullptr;
  report->plan_.images.emplace(
      ImagePlan{std::nullopt, grid, std::move(*materials), std::move(*solids), std::move(dose), std::nullopt});
  for (const LayerRecord& record : manifest.layers) report->layers_.push_back(record.layer);
  report->vanished_.resize(manifest.layers.size());
  return report;
}

// Bleed that cannot be computed again is not reported.
void ReportBleed::inspect(const Layer& layer) {
  const LayerImager imager(plan_);
  ImageWork& work = work_.local();
  LayerRecord record;
  ImageNotes notes;
  if (!imager.raster(layer, work, record, notes)) return;
  if (plan_.job.levels > 0) imager.shares(layer, work, record);
  if (imager.images(layer, work, notes) && imager.bleed(layer, work, notes))
    vanished_[layer.index - layers_.front().index] = notes.vanished;
}

void ReportBleed::report(std::vector<Warning>& warnings) const {
  checks::VanishCount count;
  for (std::size_t i = 0; i < layers_.size(); ++i) count.add(layers_[i], vanished_[i]);
  count.report(plan_.images->grid, mirrors_x(plan_.job.mirror), mirrors_y(plan_.job.mirror), warnings);
}

// The machine and the dose are planned as they were; that they could be, the job has shown.
void ReportWarnings::plan_again(const Machine* machine, const Scene& scene) {
  const ManifestHead& head = manifest_.head;
  if (const auto grid = machine != nullptr ? program::make_head_grid(*machine) : Error{}; grid) {
    heights::LayerTable table;
    for (const LayerRecord& record : manifest_.layers) table.add(record.layer.thickness, record.layer.reason);
    if (auto steps = heights::check_build_steps(*machine, table); steps && !steps->empty())
      reports_.push_back({"build-steps", std::move(*steps)});
    warn_of_machine(*machine, *grid, reports_);
  }
  FillRequest fill = job_.fill;
  if (fills(job_)) static_cast<void>(plan_bead_segments(job_, fill, reports_));
  job_.allow_unbound = true;
  static_cast<void>(DosePlan(job_, head.grid)
                        .decide(
                            job_, machine, head.sweep_drops, scene, head.layer_count, {head.first_layer, head.last_layer},
                            [this](std::uint32_t i) { return manifest_.layers[i].layer; }, reports_));
}

void ReportWarnings::plan_paths_again() {
  const auto resolved = resolve(job_, Product::kMoves);
  if (!resolved) return;
  FillRequest fill = resolved->job.fill;
  const auto segments = plan_segments(resolved->job.segment, resolved->extruder->calibration, fill);
  if (segments) warn_of_segments(*segments, *resolved->extruder, fills(resolved->job), reports_);
}

void ReportWarnings::inspect_records() {
  const ManifestHead& head = manifest_.head;
  checks::LayerRecords records;
  checks::PathWarnings paths;
  std::uint64_t moves = 0;
  for (const LayerRecord& record : manifest_.layers) {
    records.add(record.layer, record.set_pixels, record.program.lost, record.capped_rows);
    if (!record.paths) continue;
    const auto& segments = record.paths->deposited.segments;
    paths.add(record.layer, record.paths->open, segments.lines, segments.thin);
    moves += record.paths->totals.part_moves();
  }
  records.report(head.parts, reports_);
  if (head.product == Product::kMoves) paths.report(fills(job_), moves, head.layer_count, reports_);
  for (std::size_t m = 0; m < head.materials.size(); ++m) {
    UnfedPowder powder{head.materials[m].name};
    for (const LayerRecord& record : manifest_.layers)
      powder.add(record.layer, record.image_of(m, head.materials.size()).unfed_pixels);
    checks::warn_of_unfed(powder, reports_);
  }
}

ReportWarnings::ReportWarnings(const Manifest& manifest, const Job& job, const Machine* machine, const Scene* scene)
    : manifest_(manifest), job_(job) {
  const ManifestHead& head = manifest.head;
  Scene boxes;  // of first copies
  for (std::uint32_t p = 0; scene == nullptr && p < head.parts.size(); ++p) {
    boxes.meshes.emplace_back().bounds = head.parts[p].bounds;
    boxes.instances.push_back({p, {0, 0, 0}});
    boxes.part_of_instance.push_back(p);
  }
  std::vector<checks::Solid> solids = solids_from_above(scene != nullptr ? *scene : boxes);
  // Beads, doses and edges that grow change the volume on purpose.
  const bool whole = !thins(job) && !any_bleed(job, [](double um) { return um < 0; });
  for (checks::Solid& solid : solids) solid.closed = solid.closed && whole && scene != nullptr;
  tally_ = std::make_unique<checks::Tally>(std::move(solids));
  std::vector<Nm> planes;
  for (const LayerRecord& record : manifest.layers) planes.push_back(record.layer.plane());
  crossed_.resize(planes.size(), 0);
  const bool thinned = head.product == Product::kImages && thins(job);
  if (scene != nullptr && !thinned) crossed_ = checks::crossed_planes(scene->meshes, scene->instances, planes);
  if (scene != nullptr) union_mm3_ = union_in(*scene, *tally_);
  const Scene& parts = scene != nullptr ? *scene : boxes;
  std::int64_t height = 0;
  for (const Instance& instance : parts.instances) height = std::max<std::int64_t>(height, box_of(parts, instance).hi.z);
  const bool all = manifest.layers.size() == head.layer_count, images = head.product == Product::kImages;
  if (all && covers_top(job) && job.heights.containment == Containment::kInside)
    checks::warn_of_open_top(manifest.layers.back().layer, height, reports_);
  if (images) tally_->inspect_layers(head.grid);
  if (images && all) plan_again(machine, parts);
  if (!images) plan_paths_again();
  inspect_records();
  if (images && scene != nullptr) bleed_ = ReportBleed::make(manifest, job, machine, *scene);
}

void ReportWarnings::inspect(const Layer& layer, RowRuns image) {
  if (manifest_.head.product != Product::kImages) return;
  if (bleed_) bleed_->inspect(layer);
  tally_->add_image(layer, image, mirrors_x(job_.mirror), mirrors_y(job_.mirror));
}

std::vector<Warning> ReportWarnings::report(const std::vector<std::uint64_t>& set) const {
  const ManifestHead& head = manifest_.head;
  std::vector<Warning> warnings = reports_;
  if (bleed_) bleed_->report(warnings);
  if (head.first_layer != 0 || head.last_layer != head.layer_count) return warnings;
  const bool images = head.product == Product::kImages;
  checks::Sampling sampling = sampling_of(job_, images ? &head.grid : nullptr);
  std::vector<std::string> names;
  for (const PartSummary& part : head.parts) names.push_back(part.path);
  sampling.part = names;
  sampling.union_mm3 = union_mm3_;
  sampling.finished = true;
  sampling.bleeds = images && any_bleed(job_, [](double um) { return um > 0; });
  sampling.drops_none = std::ranges::any_of(reports_, [](const Warning& warning) { return warning.code == "no-drop"; });
  std::vector<std::uint8_t> filled;
  for (const std::uint64_t pixels : set) filled.push_back(pixels > 0 ? 1 : 0);
  for (const LayerRecord& record : manifest_.layers) {
    sampling.thickest_mm = std::max(sampling.thickest_mm, mm(record.layer.thickness));
  }
  const bool nothing = std::ranges::find(filled, 1) == filled.end();
  if (nothing) warnings.push_back({"empty", "the whole job is empty"});
  for (std::size_t i = 0; !nothing && i < filled.size(); ++i) {
    if (crossed_[i] == 0) filled[i] = 1;
  }
  if (images && !nothing) static_cast<void>(checks::check_solids(*tally_, sampling, warnings));
  checks::check_layers(
      tally_->solids(), filled, [&](std::uint32_t i) { return manifest_.layers[i].layer; }, warnings);
  checks::check_tolerance(tally_->solids(), sampling, warnings);
  if (head.product == Product::kMoves) checks::check_footing(tally_->solids(), sampling, warnings);
  return warnings;
}

}  // namespace lamina::pipeline
