#include "pipeline/run/job_cost.h"

#include <algorithm>

#include "pipeline/run/sanity.h"
#include "stages/slice/bodies.h"

namespace lamina::pipeline {

JobCost::JobCost(const Machine& machine, const Manifest& manifest)
    : account_(machine, manifest.head.grid, manifest.head.parts,
               std::ranges::any_of(manifest.layers, [](const LayerRecord& record) { return !record.part_pixels.empty(); }),
               title_of(manifest.head.parts)) {}

// What images set is nobody's window: with them the job is told as one.
JobCost::JobCost(const Plan& plan)
    : account_(plan.images->machine->machine, plan.images->grid, plan.scene->parts,
               plan.scene->images.empty() && (plan.job.quote || cost::has_prices(plan.images->machine->machine.cost)),
               title_of(plan.scene->parts)) {
  if (account_.parts() < 2) return;
  saturates_ = plan.images->dose.saturates();
  several_ = plan.images->dose.most_drops() > 1;
  full_ = plan.images->dose.full();
  const std::vector<sanity::Solid> solids = solids_from_above(*plan.scene);
  std::vector<Box> boxes;
  for (const sanity::Solid& solid : solids) {
    Box box = full_ > 0 ? cost::box_of_voxels(solid.box, plan.images->grid) : solid.box;
    const auto [by_x, by_y] = plan.images->dose.zones().grows_nm(plan.images->dose.zones().of_part(solid.part));
    box.lo.x -= static_cast<Nm>(by_x), box.hi.x += static_cast<Nm>(by_x);
    box.lo.y -= static_cast<Nm>(by_y), box.hi.y += static_cast<Nm>(by_y);
    boxes.push_back(box);
  }
  const std::vector<std::uint32_t> group = slice::group_seen_from_above(boxes);  // anew, for boxes have grown
  std::vector<cost::Body> bodies;
  for (std::size_t i = 0; i < solids.size(); ++i) bodies.push_back({boxes[i], solids[i].part, group[i]});
  const Mirror mirror = plan.job.mirror;
  const bool mirrored = mirror != Mirror::kNone;
  windows_.emplace(bodies, account_.parts(), plan.images->grid, mirrored && mirror != Mirror::kY,
                   mirrored && mirror != Mirror::kX);
}

void JobCost::count(const RunsView& image, const dose::DropWork& drops, LayerRecord& record) const {
  if (!windows_) return;
  if (full_ > 0) {
    const Levels& voxels = saturates_ ? drops.zones : drops.shares;
    record.part_pixels = windows_->share(record.layer, voxels, full_, record.dosed_pixels);
  } else {
    record.part_pixels = saturates_ ? windows_->count(record.layer, drops.zones) : windows_->count(record.layer, image);
  }
  if (saturates_) {
    record.part_drops = several_ ? windows_->sum(record.layer, drops.levels) : windows_->count(record.layer, image);
  }
}

void JobCost::add(const LayerRecord& record, std::uint64_t drops, std::int64_t microseconds) {
  if (record.layer.index == 0) account_.tally().add_base();
  account_.tally().add(record.layer.thickness, microseconds, drops, record.filled_pixels(), record.part_pixels,
                       record.part_drops);
}

}  // namespace lamina::pipeline
