#include "pipeline/plan/dose.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/dose/saturate.h"
#include "stages/write/levels/level_format.h"

namespace lamina::pipeline {

DosePlan::DosePlan(const Job& job, const PixelGrid& grid)
    : zones_(job, grid),
      rules_{static_cast<std::uint8_t>(job.levels > 0 ? job.levels - 1 : 0), job.dose.dithered, {}, 0},
      core_(job.dose.core),
      grid_(grid) {
  const std::int64_t shell = nm_of(job.dose.shell_mm);
  if (job.dose.saturation_percent) {
    wishes_.emplace().all = {*job.dose.saturation_percent, job.dose.core_saturation_percent};
    for (const SaturationRange& range : job.dose.saturation_ranges) {
      wishes_->ranges.push_back({range.from_mm, range.to_mm, {range.percent, range.core_percent}});
    }
    wishes_->own = zones_.wishes();
  }
  if (core_ < 1 || (wishes_ && wishes_->has_core())) rules_.shell = dose::reach_of(grid, shell, shell);
}

void DosePlan::thin(std::uint32_t layer, Runs& image, Runs& second, Runs& third) const {
  if (core_ >= 1) return;
  if (!rules_.shell.half_width.empty()) dose::erode(image, rules_.shell, third);
  dose::saturate(image, rules_.shell.half_width.empty() ? image.view() : third.view(), core_, layer, second);
  std::swap(image, second);
}

Status DosePlan::decide(const Job& job, const Machine* machine, std::uint32_t sweep_drops, const Scene& scene,
                        std::uint32_t layers, const std::function<Layer(std::uint32_t)>& layer,
                        std::vector<Warning>& warnings) {
  const bool asked = wishes_.has_value();
  // Without a machine, formats that carry levels have those of the voxels.
  if (asked || (job.levels > 0 && (machine != nullptr || write::find_level_format(job.format) == nullptr)))
    rules_.most_drops = 1;
  // Levels that are not dithered are drops to a head that fires several.
  if (machine != nullptr && machine->head.most_drops > 1 && rules_.full > 0 && !rules_.dithered && !asked)
    full_drops_ = rules_.full;
  rules_.most_drops *= full_drops_;
  limit_ = dose::kMostDrops;
  if (machine != nullptr && machine->head.most_drop_sweeps > 0)
    limit_ = std::min(limit_, machine->head.most_drop_sweeps * sweep_drops);
  if (full_drops_ > limit_) {
    return Error{Fault::kUsage,
                 fmt::format("--levels {}: {} drops of a full voxel, {} can be jetted (head.most_drop_sweeps of {} in "
                             "each); choose fewer levels, or give --saturation",
                             rules_.full + 1, full_drops_, limit_, sweep_drops)};
  }
  if (machine == nullptr || machine->head.drop_pl == 0) {
    if (!asked) return {};
    return Error{Fault::kUsage, fmt::format("--saturation: {}",
                                            machine == nullptr ? "is of drops, and no machine tells how large; add --machine"
                                                               : "head.drop_pl of the machine is 0; state its drop")};
  }
  const auto& powder = machine->powder;
  binder_ = {machine->head.drop_pl, powder.evaporates_percent / 100, powder.packing};
  const auto pitch = static_cast<std::int64_t>(std::ceil(1 / std::min(grid_.x.pixels_per_nm(), grid_.y.pixels_per_nm())));
  budget_.emplace(binder_, grid_, wishes_, limit_, powder.least_saturation_percent,
                  dose::Jetting{rules_.dithered, !rules_.shell.half_width.empty(), core_, full_drops_},
                  dose::Stretches(zone_boxes(scene, zones_, grid_), zones_.count(), nm_of(job.dose.shell_mm), pitch));
  for (std::uint32_t i = 0; i < layers; ++i) budget_->foresee(layer(i));
  if (asked) rules_.most_drops = std::max(1u, budget_->most_drops());
  return budget_->judge(job.allow_unbound, warnings);
}

Status DosePlan::check_images(std::string_view format, bool several) const {
  const auto refuse = [](std::string text) { return Error{Fault::kUsage, std::move(text)}; };
  const bool grey = saturates() && write::find_level_format(format) != nullptr;
  if (several && grey)
    return refuse(fmt::format("--format {}: drops of several materials have images of 1 bit; choose tiff-g4", format));
  if (several && most_drops() > 1)
    return refuse("--saturation: several drops a pixel of several materials are not planned together; plan them apart");
  if (!grey || format != "tiff-4" || most_drops() <= 15) return {};
  return refuse(fmt::format("--format tiff-4: tells up to 15 drops of a pixel, the job has {}; choose tiff-8", most_drops()));
}

dose::ZoneSums DosePlan::saturate(const Layer& layer, Runs& image, std::span<const Runs> zone, Runs& second,
                                  dose::DropWork& work) const {
  const auto dose_of = [&](std::uint32_t z) {
    dose::LayerDose dose = wishes_ ? dose::dose_of(layer, *wishes_, binder_, grid_, limit_, z) : dose::one_drop(full_drops_);
    // Of shares of voxels the drops of each are rounded, not those of full ones.
    if (wishes_ && !rules_.dithered && zones_.several()) dose::round_drops(dose, binder_, grid_, layer.thickness);
    return dose;
  };
  if (!zones_.several()) return dose::drops_of_layer(rules_, dose_of(0), layer.index, image, second, work);
  std::vector<dose::LayerDose> doses;
  for (std::uint32_t z = 0; z < zone.size(); ++z) doses.push_back(dose_of(z));
  return dose::drops_of_parts(rules_, doses, layer.index, zone, image, second, work);
}

std::uint64_t DosePlan::changes_bound(std::uint64_t changes, std::uint64_t covered) const {
  // A run that grows is in every row that it reaches.
  changes = edges_bound(changes);
  covered = edges_bound(covered);
  // Of blue noise at most every pixel differs from the one before it.
  if (saturates()) return changes + covered + 2;
  if (core_ >= 1) return changes;
  return changes + static_cast<std::uint64_t>(2 * std::min(core_, 1 - core_) * static_cast<double>(covered)) + 2;
}

}  // namespace lamina::pipeline
