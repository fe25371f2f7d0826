#include "pipeline/show/report_doubts.h"

#include <algorithm>

#include "pipeline/run/sanity.h"
#include "stages/sanity/crossed.h"

namespace lamina::pipeline {

ReportDoubts::ReportDoubts(const Manifest& manifest, const Job& job, const Scene* scene) : manifest_(manifest), job_(job) {
  const ManifestHead& head = manifest.head;
  Scene boxes;  // of first copies
  for (std::uint32_t p = 0; scene == nullptr && p < head.parts.size(); ++p) {
    boxes.meshes.emplace_back().bounds = head.parts[p].bounds;
    boxes.instances.push_back({p, {0, 0, 0}});
    boxes.part_of_instance.push_back(p);
  }
  std::vector<sanity::Solid> solids = solids_from_above(scene != nullptr ? *scene : boxes);
  // Beads and doses change the volume on purpose.
  const bool whole = !thins(job) && std::ranges::all_of(bleeds_of(job), [](const std::array<double, 2>& um) {
    return um == std::array{0.0, 0.0};
  });
  for (sanity::Solid& solid : solids) solid.closed = solid.closed && whole && scene != nullptr;
  tally_ = std::make_unique<sanity::Tally>(std::move(solids));
  std::vector<Nm> planes;
  for (const LayerRecord& record : manifest.layers) planes.push_back(record.layer.plane());
  crossed_.resize(planes.size(), 0);
  const bool thinned = head.product == Product::kImages && thins(job);
  if (scene != nullptr && !thinned) crossed_ = sanity::crossed_planes(scene->meshes, scene->instances, planes);
  if (scene != nullptr) united_mm3_ = united_in(*scene, *tally_);
  if (head.product == Product::kImages) tally_->look_through(head.grid);
}

void ReportDoubts::look(const Layer& layer, const RunsView& image) {
  if (manifest_.head.product != Product::kImages) return;
  const Mirror mirror = job_.mirror;
  tally_->add_image(layer, image, mirror == Mirror::kX || mirror == Mirror::kXY, mirror == Mirror::kY || mirror == Mirror::kXY);
}

std::vector<Warning> ReportDoubts::tell(const std::vector<std::uint64_t>& set) const {
  const ManifestHead& head = manifest_.head;
  std::vector<Warning> warnings;
  if (head.first_layer != 0 || head.last_layer != head.layer_count) return warnings;
  const bool images = head.product == Product::kImages;
  sanity::Sampling sampling = sampling_of(job_, images ? &head.grid : nullptr);
  std::vector<std::string> names;
  for (const PartSummary& part : head.parts) names.push_back(part.path);
  sampling.part = names;
  sampling.united_mm3 = united_mm3_;
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
