#include "pipeline/show/report_bleed.h"

#include <algorithm>
#include <utility>

namespace lamina::pipeline {

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

// What cannot be made again is not told.
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

}  // namespace lamina::pipeline
