#include "pipeline/show/report_doubts.h"

#include <algorithm>

#include "pipeline/plan/dose.h"
#include "pipeline/run/sanity.h"
#include "stages/program/head_grid.h"
#include "stages/sanity/crossed.h"
#include "stages/sanity/records.h"

namespace lamina::pipeline {
namespace {

bool any_bleed(const Job& job, bool (*is)(double)) {
  return std::ranges::any_of(bleeds_of(job), [&](const auto& um) { return std::ranges::any_of(um, is); });
}

}  // namespace

// The machine and the dose are planned as they were; that they could be, the job has shown.
void ReportDoubts::plan_again(const Machine* machine, const Scene& scene) {
  const ManifestHead& head = manifest_.head;
  if (const auto grid = machine != nullptr ? program::make_head_grid(*machine) : Error{}; grid)
    warn_of_machine(*machine, *grid, told_);
  job_.allow_unbound = true;
  static_cast<void>(DosePlan(job_, head.grid)
                        .decide(
                            job_, machine, head.sweep_drops, scene, head.layer_count, {head.first_layer, head.last_layer},
                            [this](std::uint32_t i) { return manifest_.layers[i].layer; }, told_));
}

void ReportDoubts::look_at_records() {
  const std::vector<JobMaterial>& materials = manifest_.head.materials;
  std::uint64_t lost = 0;
  for (const LayerRecord& record : manifest_.layers) lost += record.program.lost;
  sanity::warn_of_lost_pixels(lost, told_);
  for (std::size_t m = 0; m < materials.size(); ++m) {
    UnfedPowder powder{materials[m].name};
    for (const LayerRecord& record : manifest_.layers)
      powder.add(record.layer, record.image_of(m, materials.size()).unfed_pixels);
    sanity::warn_of_unfed(powder, told_);
  }
}

ReportDoubts::ReportDoubts(const Manifest& manifest, const Job& job, const Machine* machine, const Scene* scene)
    : manifest_(manifest), job_(job) {
  const ManifestHead& head = manifest.head;
  Scene boxes;  // of first copies
  for (std::uint32_t p = 0; scene == nullptr && p < head.parts.size(); ++p) {
    boxes.meshes.emplace_back().bounds = head.parts[p].bounds;
    boxes.instances.push_back({p, {0, 0, 0}});
    boxes.part_of_instance.push_back(p);
  }
  std::vector<sanity::Solid> solids = solids_from_above(scene != nullptr ? *scene : boxes);
  // Beads, doses and edges that grow change the volume on purpose.
  const bool whole = !thins(job) && !any_bleed(job, [](double um) { return um < 0; });
  for (sanity::Solid& solid : solids) solid.closed = solid.closed && whole && scene != nullptr;
  tally_ = std::make_unique<sanity::Tally>(std::move(solids));
  std::vector<Nm> planes;
  for (const LayerRecord& record : manifest.layers) planes.push_back(record.layer.plane());
  crossed_.resize(planes.size(), 0);
  const bool thinned = head.product == Product::kImages && thins(job);
  if (scene != nullptr && !thinned) crossed_ = sanity::crossed_planes(scene->meshes, scene->instances, planes);
  if (scene != nullptr) united_mm3_ = united_in(*scene, *tally_);
  if (head.product != Product::kImages) return;
  tally_->look_through(head.grid);
  if (manifest.layers.size() == head.layer_count) plan_again(machine, scene != nullptr ? *scene : boxes);
  look_at_records();
}

void ReportDoubts::look(const Layer& layer, const RunsView& image) {
  if (manifest_.head.product != Product::kImages) return;
  const Mirror mirror = job_.mirror;
  tally_->add_image(layer, image, mirror == Mirror::kX || mirror == Mirror::kXY, mirror == Mirror::kY || mirror == Mirror::kXY);
}

std::vector<Warning> ReportDoubts::tell(const std::vector<std::uint64_t>& set) const {
  const ManifestHead& head = manifest_.head;
  std::vector<Warning> warnings = told_;
  if (head.first_layer != 0 || head.last_layer != head.layer_count) return warnings;
  const bool images = head.product == Product::kImages;
  sanity::Sampling sampling = sampling_of(job_, images ? &head.grid : nullptr);
  std::vector<std::string> names;
  for (const PartSummary& part : head.parts) names.push_back(part.path);
  sampling.part = names;
  sampling.united_mm3 = united_mm3_;
  sampling.finished = true;
  sampling.bleeds = images && any_bleed(job_, [](double um) { return um > 0; });
  sampling.drops_none = std::ranges::any_of(told_, [](const Warning& warning) { return warning.code == "no-drop"; });
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
  if (images && !nothing) static_cast<void>(sanity::judge_solids(*tally_, sampling, warnings));
  sanity::judge_layers(
      tally_->solids(), filled, [&](std::uint32_t i) { return manifest_.layers[i].layer; }, warnings);
  sanity::judge_tolerance(tally_->solids(), sampling, warnings);
  if (head.product == Product::kMoves) sanity::judge_footing(tally_->solids(), sampling, warnings);
  return warnings;
}

}  // namespace lamina::pipeline
