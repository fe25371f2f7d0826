#include "pipeline/plan/dose.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/plan/sections.h"
#include "stages/data/mesh.h"
#include "stages/dose/dither.h"
#include "stages/formats/image_format.h"
#include "stages/program/head_grid.h"
#include "stages/program/maintenance.h"

namespace lamina::pipeline {

DoseZones::DoseZones(const Job& job, const PixelGrid& grid) : bleeds_(job.dose.first_bleed_um ? job.dose.first_layers : 0) {
  const DoseRequest& dose = job.dose;
  const auto zone_of = [&](const PartRequest* part) {
    const bool own = part != nullptr && part->bleed_um;
    const dose::BleedUm outside = own ? *part->bleed_um : dose.bleed_um;
    dose::BleedUm holes = own ? outside : dose.hole_bleed_um.value_or(outside);
    if (part != nullptr && part->hole_bleed_um) holes = *part->hole_bleed_um;
    Zone zone;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double first = dose.first_bleed_um ? (*dose.first_bleed_um)[axis] : 0;
      zone.grows_nm[axis] = std::max<std::int64_t>(0, std::llround(-1000 * std::min(outside[axis], first)));
    }
    zone.bleed.above = dose::bleed_of(grid, outside, holes);
    zone.bleed.first =
        dose.first_bleed_um ? dose::bleed_of(grid, *dose.first_bleed_um, *dose.first_bleed_um) : zone.bleed.above;
    if (part != nullptr && part->saturation_percent)
      zone.target = dose::DoseTarget{*part->saturation_percent, part->core_saturation_percent};
    return zone;
  };
  zones_.push_back(zone_of(nullptr));
  for (const PartRequest& part : job.parts) {
    Zone zone = zone_of(&part);
    const auto found = std::ranges::find(zones_, zone);
    of_part_.push_back(static_cast<std::uint32_t>(found - zones_.begin()));
    if (found == zones_.end()) zones_.push_back(std::move(zone));
  }
  for (const Zone& zone : zones_) bleeds_.add_zone(zone.bleed);
}

std::vector<std::optional<dose::DoseTarget>> DoseZones::targets() const {
  std::vector<std::optional<dose::DoseTarget>> targets;
  for (std::size_t zone = 1; zone < zones_.size(); ++zone) targets.push_back(zones_[zone].target);
  return targets;
}

std::vector<dose::ZoneBox> zone_boxes(const Scene& scene, const DoseZones& zones, const PixelGrid& grid) {
  std::vector<dose::ZoneBox> boxes;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const std::uint32_t zone = zones.of_part(scene.part_of_instance[i]);
    const auto [x, y] = zones.grows_nm(zone);
    const Box box = box_of(scene, scene.instances[i]);
    boxes.push_back(
        {zone, {box.lo.x - x, box.lo.y - y, box.lo.z}, {box.hi.x + x, box.hi.y + y, box.hi.z}, {box.lo.x, box.lo.y, box.lo.z}});
  }
  for (const PlacedImages& of : scene.images) {  // anywhere on the bed
    const std::int64_t top = of.bottom + std::int64_t{of.thickness} * of.images->layers();
    boxes.push_back({zones.of_part(of.part), {0, 0, of.bottom}, {grid.x.length, grid.y.length, top}});
  }
  return boxes;
}

DosePlan::DosePlan(const Job& job, const PixelGrid& grid)
    : zones_(job, grid),
      rules_{static_cast<std::uint8_t>(job.levels > 0 ? job.levels - 1 : 0), job.dose.dithered, {}, 0, job.dose.core < 1},
      core_(job.dose.core),
      grid_(grid),
      mirror_(job.mirror) {
  const std::int64_t shell = nm_of(job.dose.shell_mm);
  if (job.dose.saturation_percent) {
    targets_.emplace().all = {*job.dose.saturation_percent, job.dose.core_saturation_percent};
    for (const SaturationRange& range : job.dose.saturation_ranges) {
      targets_->ranges.push_back({range.from_mm, range.to_mm, {range.percent, range.core_percent}});
    }
    targets_->own = zones_.targets();
  }
  if (thins() || (targets_ && targets_->has_core())) rules_.shell = dose::reach_of(grid, shell, shell);
}

void DosePlan::thin(std::uint32_t layer, const Runs& image, Runs& second, dose::DropWork& work) const {
  dose::drops_of_core(rules_, core_, layer, image, second, work);
}

Status DosePlan::decide(const Job& job, const Machine* machine, std::uint32_t sweep_drops, const Scene& scene,
                        std::uint32_t layers, const std::array<std::uint32_t, 2>& range,
                        const std::function<Layer(std::uint32_t)>& layer, std::vector<Warning>& warnings) {
  if (core_ == 0 &&
      static_cast<double>(nm_of(job.dose.shell_mm)) * std::max(grid_.x.pixels_per_nm(), grid_.y.pixels_per_nm()) < 1) {
    warnings.push_back({"no-drop",
                        "dose.core: 0 without a shell of at least a pixel jets no drop, the parts stay loose powder; add "
                        "--shell or give a share above 0"});
  }
  const bool requested = targets_.has_value();
  // Without a machine, formats that carry levels have those of the voxels.
  if (requested || (job.levels > 0 && (machine != nullptr || formats::find_level_format(job.format) == nullptr)))
    rules_.max_drops = 1;
  // Levels that are not dithered are drops to a head that fires several.
  if (machine != nullptr && machine->head.max_drops > 1 && rules_.full > 0 && !rules_.dithered && !requested)
    full_drops_ = rules_.full;
  rules_.max_drops *= full_drops_;
  limit_ = dose::kMaxDrops;
  if (machine != nullptr) set_limits(*machine, sweep_drops);
  if (full_drops_ > limit_) {
    return Error{Fault::kUsage,
                 fmt::format("--levels {}: {} drops of a full voxel, {} can be jetted (head.max_drop_sweeps of {} in "
                             "each); choose fewer levels, or give --saturation",
                             rules_.full + 1, full_drops_, limit_, sweep_drops)};
  }
  if (machine == nullptr || machine->head.drop_pl == 0) {
    if (!requested) return {};
    return Error{Fault::kUsage,
                 fmt::format("--saturation: {}", machine == nullptr ? "needs the drop volume of a machine; add --machine"
                                                                    : "head.drop_pl of the machine is 0; set its drop volume")};
  }
  const auto& powder = machine->powder;
  if (!job.allow_unbound) min_percent_ = powder.min_saturation_percent;
  const auto pitch = static_cast<std::int64_t>(std::ceil(1 / std::min(grid_.x.pixels_per_nm(), grid_.y.pixels_per_nm())));
  std::vector<dose::ZoneBox> boxes = zone_boxes(scene, zones_, grid_);
  budget_.emplace(binder_, grid_, targets_, limit_, powder.min_saturation_percent,
                  dose::Jetting{rules_.dithered, !rules_.shell.half_width.empty(), core_, full_drops_},
                  dose::CoveredSpans(boxes, zones_.count(), nm_of(job.dose.shell_mm), pitch));
  if (targets_ && targets_->has_formula()) {
    copies_.resize(targets_->zones());
    for (const dose::ZoneBox& box : boxes) {
      if (targets_->is_own(box.zone) && targets_->own[box.zone - 1]->has_formula()) copies_[box.zone].push_back(box);
    }
    budget_->survey(std::move(boxes), layers);
  }
  for (std::uint32_t i = 0; i < layers; ++i) budget_->foresee(layer(i), i >= range[0] && i < range[1]);
  if (requested) rules_.max_drops = std::max(1u, budget_->max_drops());
  return budget_->check(job.allow_unbound, warnings);
}

void DosePlan::set_limits(const Machine& machine, std::uint32_t sweep_drops) {
  if (machine.head.max_drop_sweeps > 0) limit_ = std::min(limit_, machine.head.max_drop_sweeps * sweep_drops);
  binder_ = {machine.head.drop_pl, machine.powder.evaporates_percent / 100, machine.powder.packing};
}

void DosePlan::restore(const Machine& machine, std::uint32_t sweep_drops, std::uint32_t max_drops) {
  limit_ = dose::kMaxDrops;
  set_limits(machine, sweep_drops);
  rules_.max_drops = max_drops;
}

void warn_of_machine(const Machine& machine, const HeadGrid& grid, std::vector<Warning>& warnings) {
  program::warn_of_idle_maintenance(machine, warnings);
  program::warn_of_fixed_stitching(machine, grid, warnings);
}

Status DosePlan::check_images(std::string_view format) const {
  if (format != "tiff-4" || max_drops() <= 15) return {};
  return Error{Fault::kUsage,
               fmt::format("--format tiff-4: stores up to 15 drops per pixel, the job has {}; choose tiff-8", max_drops())};
}

bool DosePlan::has_formula(const Layer& layer) const {
  for (std::uint32_t zone = 0; targets_ && !copies_.empty() && zone < targets_->zones(); ++zone) {
    if (targets_->of(layer, zone).has_formula()) return true;
  }
  return false;
}

Result<dose::ZoneSums> DosePlan::saturate_deposited(const Layer& layer, std::uint32_t materials, const Runs& image,
                                                    Runs& second, dose::DropWork& work) const {
  dose::Sheet sheet{grid_, mirror_ == Mirror::kX || mirror_ == Mirror::kXY, mirror_ == Mirror::kY || mirror_ == Mirror::kXY,
                    layer};
  sheet.limit = dose::Drops24{limit_ > 0 ? limit_ : 1} << dose::kDropBits;
  sheet.dithered = rules_.dithered;
  if (targets_) {
    sheet.limit = std::min(sheet.limit, dose::Drops24{rules_.max_drops} << dose::kDropBits);
    sheet.scale = dose::DropScale(binder_, grid_, layer.thickness);
    sheet.minimum = sheet.scale.drops(min_percent_ * (1 - 1e-6));
    sheet.min_percent = min_percent_;
  }
  work.fields.resize(std::size_t{2} * zones_.count());
  const dose::DropRequest one{dose::Drops24{full_drops_} << dose::kDropBits};
  std::vector<std::array<dose::DropRequest, 2>> requests(zones_.count(), {one, one});
  for (std::uint32_t zone = 0; targets_ && zone < zones_.count(); ++zone) {
    const dose::DoseTarget& target = targets_->of(layer, zone);
    for (std::size_t inside = 0; inside < 2; ++inside) {
      const Saturation& wanted = inside == 0 ? target.percent : target.of_core();
      if (wanted.formula.empty()) {
        constexpr std::uint32_t kAny = 1u << 20;
        requests[zone][inside].drops = dose::drops_for(wanted.percent, binder_, grid_, layer.thickness, kAny);
        continue;
      }
      dose::Field& field = work.fields[2 * zone + inside];
      const bool own = targets_->is_own(zone);
      const bool core = inside == 1 && target.core_percent;
      const std::string_view key = own    ? core ? "part.core_saturation_percent" : "part.saturation_percent"
                                   : core ? "--core-saturation"
                                          : "--saturation";
      Status status = field.start(wanted.formula, key, sheet,
                                  own ? std::span<const dose::ZoneBox>(copies_[zone]) : std::span<const dose::ZoneBox>());
      if (!status) return status.error();
      requests[zone][inside].field = &field;
    }
  }
  return dose::drops_of_deposited(rules_, sheet, requests, materials, image, second, work);
}

Result<dose::ZoneSums> DosePlan::saturate(const Layer& layer, bool deposited, std::uint32_t materials, const Runs& image,
                                          std::span<const Runs> zone, Runs& second, dose::DropWork& work) const {
  if (deposited) return saturate_deposited(layer, materials, image, second, work);
  if (has_formula(layer)) {
    work.deposited.resize(zones_.count());
    for (std::uint32_t z = 0; z < zones_.count(); ++z) {
      dose::DepositedPart& part = work.deposited[z];
      part.zone = z;
      part.material = 0;
      if (rules_.full > 0) {
        std::swap(part.shares, work.shares);
      } else {
        levels_of(zones_.several() ? zone[z].view() : image.view(), 1, part.shares);
      }
    }
    return saturate_deposited(layer, 1, image, second, work);
  }
  const auto dose_of = [&](std::uint32_t z) {
    dose::LayerDose dose = targets_ ? dose::dose_of(layer, *targets_, binder_, grid_, limit_, z) : dose::one_drop(full_drops_);
    // Of shares of voxels the drops of each are rounded, not those of full ones.
    if (targets_ && !rules_.dithered && zones_.several()) dose::round_drops(dose, binder_, grid_, layer.thickness);
    return dose;
  };
  if (!zones_.several()) return dose::drops_of_layer(rules_, dose_of(0), layer.index, image, second, work);
  std::vector<dose::LayerDose> doses;
  for (std::uint32_t z = 0; z < zone.size(); ++z) doses.push_back(dose_of(z));
  return dose::drops_of_parts(rules_, doses, layer.index, zone, image, second, work);
}

std::uint64_t DosePlan::parted_pixels(const Runs& image, const dose::DropWork& work) const {
  if (!parts_pixels()) return 0;
  if (rules_.full > 0) {
    const std::uint64_t full = pixels_at(work.shares, rules_.full);
    return pixels_at(work.shares) - (targets_ ? 0 : full);
  }
  const std::uint64_t pixels = edges_bound(set_pixels(image));  // at most, where edges grow
  return core_ >= 1 ? pixels : static_cast<std::uint64_t>(2 * std::min(core_, 1 - core_) * static_cast<double>(pixels)) + 2;
}

}  // namespace lamina::pipeline
