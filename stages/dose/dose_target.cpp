#include "stages/dose/dose_target.h"

#include <algorithm>

#include "stages/data/units.h"

namespace lamina::dose {
namespace {

bool differs(const DoseTarget& target) { return !(target.of_core() == target.percent); }

double per_cent(Drops24 drops, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  return saturation_of(static_cast<double>(drops) / static_cast<double>(kOneDrop), binder, grid, thickness_nm);
}

}  // namespace

std::size_t DoseTargets::target_index(const Layer& layer, std::uint32_t zone) const {
  if (is_own(zone)) return ranges.size() + zone;
  const Nm plane = layer.plane();
  for (std::size_t position = ranges.size(); position > 0; --position) {
    const DoseTargetRange& range = ranges[position - 1];
    if (plane >= nm_of(range.from_mm) && plane < nm_of(range.to_mm)) return position;
  }
  return 0;
}

bool DoseTargets::has_core() const {
  return differs(all) || std::ranges::any_of(ranges, [](const DoseTargetRange& range) { return differs(range.target); }) ||
         std::ranges::any_of(own, [](const std::optional<DoseTarget>& target) { return target && differs(*target); });
}

bool DoseTargets::has_formula() const {
  return all.has_formula() ||
         std::ranges::any_of(ranges, [](const DoseTargetRange& range) { return range.target.has_formula(); }) ||
         std::ranges::any_of(own, [](const std::optional<DoseTarget>& target) { return target && target->has_formula(); });
}

LayerDose dose_of(const Layer& layer, const DoseTargets& targets, const Binder& binder, const PixelGrid& grid,
                  std::uint32_t maximum, std::uint32_t zone) {
  const DoseTarget& target = targets.of(layer, zone);
  LayerDose dose;
  dose.requested = target.percent.percent;
  dose.requested_core = target.of_core().percent;
  constexpr std::uint32_t kAny = 1u << 20;
  const Drops24 shell = drops_for(dose.requested, binder, grid, layer.thickness, kAny);
  const Drops24 core = drops_for(dose.requested_core, binder, grid, layer.thickness, kAny);
  const Drops24 limit = Drops24{maximum} << kDropBits;
  dose.cut = shell > limit || core > limit;
  dose.requested_shell = shell;
  dose.requested_inside = core;
  dose.shell = std::min(shell, limit);
  dose.core = std::min(core, limit);
  dose.gets = per_cent(dose.shell, binder, grid, layer.thickness);
  dose.gets_core = per_cent(dose.core, binder, grid, layer.thickness);
  return dose;
}

void round_drops(LayerDose& dose, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  for (Drops24* of : {&dose.shell, &dose.core}) *of = (*of + kOneDrop / 2) >> kDropBits << kDropBits;
  dose.gets = per_cent(dose.shell, binder, grid, thickness_nm);
  dose.gets_core = per_cent(dose.core, binder, grid, thickness_nm);
}

}  // namespace lamina::dose
