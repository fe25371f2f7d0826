#include "stages/dose/saturation.h"

#include <algorithm>
#include <cmath>

namespace lamina::dose {
namespace {

constexpr std::int64_t kMillion = 1'000'000;

std::int64_t millionths(double value) { return std::llround(value * kMillion); }

/// floor(2^bits a / b + 1/2) for a < b, by long division: no product of both fits into 128 bits.
std::uint64_t fraction_of(unsigned __int128 a, unsigned __int128 b, unsigned bits) {
  std::uint64_t quotient = 0;
  for (unsigned bit = 0; bit < bits; ++bit) {
    a *= 2;
    quotient *= 2;
    if (a < b) continue;
    a -= b;
    ++quotient;
  }
  return 2 * a >= b ? quotient + 1 : quotient;
}

using Uint128 = unsigned __int128;

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
  return std::min(limit, (static_cast<Drops24>(whole) << kDropBits) + fraction_of(requested % one, one, kDropBits));
}

DropScale::DropScale(const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm) {
  constexpr unsigned kBits = 88;
  constexpr Uint128 kMax = Uint128{1} << (kBits - 2);  // more than any nozzle fires, for ten millionths
  Uint128 requested = voxel_of(grid, thickness_nm) * static_cast<Uint128>(voids_of(binder));
  const Uint128 one = one_of(binder);
  if (requested == 0) return;
  of_millionth_ = kMax;
  if (requested >= one / 4) return;
  of_millionth_ = 0;
  for (unsigned bit = 0; bit < kBits; ++bit) {
    requested *= 2;
    of_millionth_ *= 2;
    if (requested < one) continue;
    requested -= one;
    ++of_millionth_;
  }
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

}  // namespace lamina::dose
