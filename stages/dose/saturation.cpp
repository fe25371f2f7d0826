#include "stages/dose/saturation.h"

#include <algorithm>
#include <cmath>

#include "stages/data/units.h"

namespace lamina::dose {
namespace {

constexpr std::int64_t kMillion = 1'000'000;

std::int64_t millionths(double value) { return std::llround(value * kMillion); }

using Uint128 = unsigned __int128;

/// floor(2^bits a / b) for a < b, by long division: no product of both fits into 128 bits. a  becomes the rest
Uint128 fraction_of(Uint128& a, Uint128 b, unsigned bits) {
  Uint128 quotient = 0;
  for (unsigned bit = 0; bit < bits; ++bit) {
    a *= 2;
    quotient *= 2;
    if (a < b) continue;
    a -= b;
    ++quotient;
  }
  return quotient;
}

/// Both in millionths.
std::int64_t voids_of(const Binder& binder) {
  return std::clamp<std::int64_t>(kMillion - millionths(binder.packing), 0, kMillion);
}
std::int64_t stays_of(const Binder& binder) {
  return std::clamp<std::int64_t>(kMillion - millionths(binder.evaporates), 0, kMillion);
}
std::int64_t target_of(double percent) { return std::clamp<std::int64_t>(millionths(percent / 100), 0, 10'000 * kMillion); }
std::int64_t drop_of(const Binder& binder) { return std::max<std::int64_t>(0, millionths(binder.drop_pl)); }  // 10^6 nm3

/// In thousandths of a nm3, at most 10^9 x 10^9 x 10^9 x 10^3 before it is divided.
Uint128 voxel_of(const PixelGrid& grid, std::int64_t thickness_nm) {
  const Uint128 area = static_cast<Uint128>(grid.x.span) * static_cast<Uint128>(grid.y.span);
  const Uint128 pixels = static_cast<Uint128>(grid.x.dots) * static_cast<Uint128>(grid.y.dots);
  return area * static_cast<Uint128>(thickness_nm) / pixels * 1000;
}
/// What one drop leaves, in the same unit times 10^12, as targets and voids are in millionths.
Uint128 one_of(const Binder& binder) {
  return static_cast<Uint128>(stays_of(binder)) * static_cast<Uint128>(drop_of(binder)) *
         (static_cast<Uint128>(kMillion) * kMillion * 1000);
}

bool any_target(const DoseTargets& targets, bool (*has)(const DoseTarget&)) {
  return has(targets.all) || std::ranges::any_of(targets.ranges, has, &DoseTargetRange::target) ||
         std::ranges::any_of(targets.own, [&](const std::optional<DoseTarget>& target) { return target && has(*target); });
}

void set_gets(LayerDose& dose, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  const auto per_cent = [&](Drops24 drops) { return saturation_of(double(drops) / kOneDrop, binder, grid, thickness_nm); };
  dose.gets = per_cent(dose.shell);
  dose.gets_core = per_cent(dose.core);
}

}  // namespace

Drops24 drops_for(double percent, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm,
                  std::uint32_t maximum) {
  const Drops24 limit = Drops24{maximum} << kDropBits;
  const std::int64_t target = target_of(percent), voids = voids_of(binder);
  if (target == 0 || voids == 0) return 0;
  const Uint128 one = one_of(binder);
  if (one == 0) return limit;
  const Uint128 requested = voxel_of(grid, thickness_nm) * static_cast<Uint128>(target) * static_cast<Uint128>(voids);
  const Uint128 whole = requested / one;
  if (whole >= maximum) return limit;
  Uint128 rest = requested % one;
  const Uint128 drops = (whole << kDropBits) + fraction_of(rest, one, kDropBits);
  return std::min(limit, static_cast<Drops24>(drops + (2 * rest >= one ? 1 : 0)));
}

DropScale::DropScale(const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  constexpr unsigned kBits = 88;
  constexpr Uint128 kMax = Uint128{1} << (kBits - 2);  // more than any nozzle fires, for ten millionths
  Uint128 requested = voxel_of(grid, thickness_nm) * static_cast<Uint128>(voids_of(binder));
  const Uint128 one = one_of(binder);
  if (requested == 0) return;
  of_millionth_ = requested >= one / 4 ? kMax : fraction_of(requested, one, kBits);
}

Drops24 DropScale::drops(double percent) const {
  constexpr Uint128 kAny = Uint128{1} << (20 + kDropBits);
  const Uint128 drops = (static_cast<Uint128>(target_of(percent)) * of_millionth_ + (Uint128{1} << 63)) >> 64;
  return static_cast<Drops24>(std::min(drops, kAny));
}

double voids_pl(const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  const double pixel_nm2 = 1 / (grid.x.pixels_per_nm() * grid.y.pixels_per_nm());
  return pixel_nm2 * static_cast<double>(thickness_nm) * 1e-12 * (1 - binder.packing);
}

double saturation_of(double drops, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  const double voids = voids_pl(binder, grid, thickness_nm);
  return voids > 0 ? 100 * drops * binder.drop_pl * (1 - binder.evaporates) / voids : 0;
}

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
  return any_target(*this, [](const DoseTarget& target) { return !(target.of_core() == target.percent); });
}

bool DoseTargets::has_formula() const {
  return any_target(*this, [](const DoseTarget& target) { return target.has_formula(); });
}

LayerDose dose_of(const Layer& layer, const DoseTargets& targets, const Binder& binder, const PixelGrid& grid,
                  std::uint32_t maximum, std::uint32_t zone) {
  const DoseTarget& target = targets.of(layer, zone);
  LayerDose dose;
  dose.requested = target.percent.percent;
  dose.requested_core = target.of_core().percent;
  constexpr std::uint32_t kAny = 1u << 20;
  dose.requested_shell = drops_for(dose.requested, binder, grid, layer.thickness, kAny);
  dose.requested_inside = drops_for(dose.requested_core, binder, grid, layer.thickness, kAny);
  const Drops24 limit = Drops24{maximum} << kDropBits;
  dose.shell = std::min(dose.requested_shell, limit);
  dose.core = std::min(dose.requested_inside, limit);
  set_gets(dose, binder, grid, layer.thickness);
  return dose;
}

void round_drops(LayerDose& dose, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  for (Drops24* of : {&dose.shell, &dose.core}) *of = rounded(*of);
  set_gets(dose, binder, grid, thickness_nm);
}

}  // namespace lamina::dose
