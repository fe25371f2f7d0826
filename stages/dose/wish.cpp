#include "stages/dose/wish.h"

#include <algorithm>

#include "stages/data/units.h"

namespace lamina::dose {
namespace {

bool differs(const Wish& wish) { return !(wish.of_core() == wish.percent); }

double per_cent(Drops24 drops, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  return saturation_of(static_cast<double>(drops) / static_cast<double>(kOneDrop), binder, grid, thickness_nm);
}

}  // namespace

std::size_t Wishes::place_of(const Layer& layer, std::uint32_t zone) const {
  if (is_own(zone)) return ranges.size() + zone;
  const Nm plane = layer.plane();
  for (std::size_t place = ranges.size(); place > 0; --place) {
    const WishRange& range = ranges[place - 1];
    if (plane >= nm_of(range.from_mm) && plane < nm_of(range.to_mm)) return place;
  }
  return 0;
}

bool Wishes::has_core() const {
  return differs(all) || std::ranges::any_of(ranges, [](const WishRange& range) { return differs(range.wish); }) ||
         std::ranges::any_of(own, [](const std::optional<Wish>& wish) { return wish && differs(*wish); });
}

bool Wishes::has_formula() const {
  return all.has_formula() || std::ranges::any_of(ranges, [](const WishRange& range) { return range.wish.has_formula(); }) ||
         std::ranges::any_of(own, [](const std::optional<Wish>& wish) { return wish && wish->has_formula(); });
}

LayerDose dose_of(const Layer& layer, const Wishes& wishes, const Binder& binder, const PixelGrid& grid, std::uint32_t most,
                  std::uint32_t zone) {
  const Wish& wish = wishes.of(layer, zone);
  LayerDose dose;
  dose.asked = wish.percent.percent;
  dose.asked_core = wish.of_core().percent;
  constexpr std::uint32_t kAny = 1u << 20;
  const Drops24 shell = drops_for(dose.asked, binder, grid, layer.thickness, kAny);
  const Drops24 core = drops_for(dose.asked_core, binder, grid, layer.thickness, kAny);
  const Drops24 limit = Drops24{most} << kDropBits;
  dose.cut = shell > limit || core > limit;
  dose.asked_shell = shell;
  dose.asked_inside = core;
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
