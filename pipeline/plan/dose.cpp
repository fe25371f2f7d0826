#include "pipeline/plan/dose.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/dose/saturate.h"
#include "stages/raster/combine.h"

namespace lamina::pipeline {

DosePlan::DosePlan(const Job& job, const PixelGrid& grid) : zones_(job, grid), core_(job.dose.core), grid_(grid) {
  const std::int64_t shell = nm_of(job.dose.shell_mm);
  if (job.dose.saturation_percent) {
    wishes_.all = {*job.dose.saturation_percent, job.dose.core_saturation_percent};
    for (const SaturationRange& range : job.dose.saturation_ranges) {
      wishes_.ranges.push_back({range.from_mm, range.to_mm, {range.percent, range.core_percent}});
    }
    wishes_.own = zones_.wishes();
  }
  if (core_ < 1 || wishes_.has_core()) shell_ = dose::reach_of(grid, shell, shell);
}

void DosePlan::thin(std::uint32_t layer, Runs& image, Runs& second, Runs& third) const {
  if (core_ >= 1) return;
  if (!shell_.half_width.empty()) dose::erode(image, shell_, third);
  dose::saturate(image, shell_.half_width.empty() ? image.view() : third.view(), core_, layer, second);
  std::swap(image, second);
}

Status DosePlan::decide(const Job& job, const Machine* machine, std::uint32_t layers,
                        const std::function<Layer(std::uint32_t)>& layer, std::vector<Warning>& warnings) {
  const bool asked = job.dose.saturation_percent.has_value();
  if (machine == nullptr || machine->head.drop_pl == 0) {
    if (!asked) return {};
    return Error{Fault::kUsage, fmt::format("--saturation: {}",
                                            machine == nullptr ? "is of drops, and no machine tells how large; add --machine"
                                                               : "head.drop_pl of the machine is 0; state its drop")};
  }
  const auto& powder = machine->powder;
  binder_ = {machine->head.drop_pl, powder.evaporates_percent / 100, powder.packing};
  limit_ = machine->head.most_drop_sweeps > 0 ? machine->head.most_drop_sweeps : dose::kMostDrops;
  budget_.emplace(binder_, grid_, asked ? std::optional(wishes_) : std::nullopt, limit_, powder.least_saturation_percent);
  for (std::uint32_t i = 0; i < layers; ++i) budget_->foresee(layer(i));
  if (asked) most_drops_ = std::max(1u, budget_->most_drops());
  return budget_->judge(job.allow_unbound, warnings);
}

std::uint64_t DosePlan::mark_zones(const Layer& layer, const Runs& image, std::span<const Runs> zone, Runs& core,
                                   DropWork& work, std::vector<dose::Drops24>& drops) const {
  const bool inside = !shell_.half_width.empty();
  if (inside) dose::erode(image, shell_, core);
  work.shells.resize(2 * zone.size());
  std::uint64_t asked = 0;
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    const dose::LayerDose dose = dose::dose_of(layer, wishes_, binder_, grid_, limit_, z);
    drops.push_back(dose.shell);
    drops.push_back(dose.core);
    Runs &shell = work.shells[2 * z], &own_core = work.shells[2 * z + 1];
    raster::combine(zone[z], inside ? core.view() : zone[z].view(), raster::SetOperation::kDifference, shell);
    raster::combine(zone[z], inside ? core.view() : zone[z].view(), raster::SetOperation::kIntersection, own_core);
    asked += budget_->asked_drops(layer, set_pixels(shell), set_pixels(own_core), z);
  }
  dose::join_zones(work.shells, work.pieces, work.zones);
  return asked;
}

std::uint64_t DosePlan::saturate(const Layer& layer, Runs& image, std::span<const Runs> zone, Runs& second,
                                 DropWork& work) const {
  std::vector<dose::Drops24> drops{0};
  std::uint64_t asked = 0;
  if (zones_.several()) {
    asked = mark_zones(layer, image, zone, second, work, drops);
  } else {
    const dose::LayerDose dose = dose::dose_of(layer, wishes_, binder_, grid_, limit_);
    const std::uint64_t dosed = set_pixels(image);
    std::uint64_t core = shell_.half_width.empty() ? dosed : 0;
    if (!shell_.half_width.empty() && dose.asked_shell != dose.asked_inside) {
      dose::erode(image, shell_, second);
      dose::mark_core(image, second, work.zones);
      core = set_pixels(second);
    } else {
      levels_of(image, shell_.half_width.empty() ? 2 : 1, work.zones);
    }
    drops.insert(drops.end(), {dose.shell, dose.core});
    asked = budget_->asked_drops(layer, dosed - core, core);
  }
  dose::dither(work.zones, drops, layer.index, work.dither, work.levels);
  work.planes.resize(most_drops_);
  for (std::uint32_t drop = 0; drop < most_drops_; ++drop) {
    at_least(work.levels, static_cast<std::uint8_t>(drop + 1), work.planes[drop]);
  }
  image.row_offset = work.planes[0].row_offset;
  image.change = work.planes[0].change;
  return asked;
}

std::uint64_t DropWork::bytes() const {
  std::uint64_t total = zones.bytes() + levels.bytes() + pieces.capacity() * sizeof(dose::ZonePiece);
  for (const auto* images : {&planes, &shells}) {
    for (const Runs& image : *images) total += bytes_held(image.row_offset) + bytes_held(image.change);
  }
  return total;
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
