#include "pipeline/run/part_counter.h"

#include <algorithm>

#include "pipeline/report/job_cost.h"
#include "pipeline/run/job_checks.h"
#include "pipeline/run/layer_imager.h"
#include "stages/slice/bodies.h"

namespace lamina::pipeline {

PartCounter::PartCounter(const Plan& plan) : plan_(plan) {
  const std::size_t parts = reported_parts(plan);
  if (parts < 2) return;
  saturates_ = plan.images->dose.saturates();
  several_ = plan.images->dose.max_drops() > 1;
  full_ = plan.images->dose.full();
  const std::vector<checks::Solid> solids = solids_from_above(*plan.scene);
  std::vector<Box> boxes;
  for (const checks::Solid& solid : solids) {
    Box box = full_ > 0 ? cost::box_of_voxels(solid.box, plan.images->grid) : solid.box;
    const auto [by_x, by_y] = plan.images->dose.zones().grows_nm(plan.images->dose.zones().of_part(solid.part));
    box.lo.x -= static_cast<Nm>(by_x), box.hi.x += static_cast<Nm>(by_x);
    box.lo.y -= static_cast<Nm>(by_y), box.hi.y += static_cast<Nm>(by_y);
    boxes.push_back(box);
  }
  const std::vector<std::uint32_t> group = slice::group_from_above(boxes);  // anew, for boxes have grown
  std::vector<cost::Body> bodies;
  for (std::size_t i = 0; i < solids.size(); ++i) bodies.push_back({boxes[i], solids[i].part, group[i]});
  const Mirror mirror = plan.job.mirror;
  // What images set is nobody's window: beside them windows are of the meshes alone, before anything is mirrored.
  const bool mirrored = mirror != Mirror::kNone && plan.scene->images.empty();
  windows_.emplace(bodies, parts, plan.images->grid, mirrored && mirror != Mirror::kY, mirrored && mirror != Mirror::kX);
}

void PartCounter::weigh(const Layer& layer, const ImageWork& work, ImageNotes& notes) const {
  if (!windows_) return;
  notes.part_pixels = full_ > 0 ? windows_->sum(layer, work.drops.shares) : windows_->count(layer, work.runs);
}

void PartCounter::count(const ImageWork& work, const ImageNotes& notes, LayerRecord& record) const {
  if (!windows_) return;
  if (!plan_.scene->images.empty()) return share_out(work, notes.part_pixels, record);
  const dose::DropWork& drops = work.drops;
  if (full_ > 0) {
    const Levels& voxels = saturates_ ? drops.zones : drops.shares;
    record.part_pixels = windows_->share(record.layer, voxels, full_, record.dosed_pixels);
  } else {
    record.part_pixels = saturates_ ? windows_->count(record.layer, drops.zones) : windows_->count(record.layer, work.runs);
  }
  if (saturates_) {
    record.part_drops = several_ ? windows_->sum(record.layer, drops.levels) : windows_->count(record.layer, work.runs);
  }
}

void PartCounter::share_out(const ImageWork& work, const std::vector<std::uint64_t>& weights, LayerRecord& record) const {
  const auto shared = [](std::uint64_t all, const std::vector<std::uint64_t>& by) {
    const auto whole = cost::shares(static_cast<std::int64_t>(all), by);
    return std::vector<std::uint64_t>(whole.begin(), whole.end());
  };
  record.part_pixels = shared(record.filled_pixels(), weights);
  const DoseZones& zones = plan_.images->dose.zones();
  if (!saturates_ || !zones.several()) return;  // drops are as pixels
  record.part_drops.assign(weights.size(), 0);
  std::vector<std::uint64_t> drops(zones.count(), 0);  // those of shared voxels count for all of theirs
  for (std::uint32_t zone = 0; full_ == 0 && zone < zones.count(); ++zone)
    drops[zone] = sum_of_levels(work.drops.levels, work.zones.image[zone]);
  for (std::size_t i = 0; full_ > 0 && i < work.drops.deposited.size(); ++i) {
    Runs voxels;
    threshold_levels(work.drops.deposited[i].shares, 1, voxels);
    drops[work.drops.deposited[i].zone] += sum_of_levels(work.drops.levels, voxels);
  }
  drops = shared(record.drops, drops);
  for (std::uint32_t zone = 0; zone < zones.count(); ++zone) {
    std::vector<std::uint64_t> within(weights.size(), 0);
    for (std::uint32_t part = 0; part < weights.size(); ++part) {
      if (zones.of_part(part) == zone) within[part] = weights[part];
    }
    if (drops[zone] == 0) continue;
    const std::vector<std::uint64_t> own = shared(drops[zone], within);
    for (std::size_t part = 0; part < own.size(); ++part) record.part_drops[part] += own[part];
  }
}

}  // namespace lamina::pipeline
