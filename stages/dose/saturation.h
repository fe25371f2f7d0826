// stages/dose/saturation.h: how many drops a pixel takes for a share of the voids to be filled with binder, and back.
#pragma once

#include <cstdint>

#include "stages/data/grid.h"

namespace lamina::dose {

/// Drops a pixel as a fixed-point number.
using Drops24 = std::uint64_t;
inline constexpr unsigned kDropBits = 24;
inline constexpr Drops24 kOneDrop = Drops24{1} << kDropBits;
/// To whole drops, half a drop up.
constexpr Drops24 rounded(Drops24 drops) { return (drops + kOneDrop / 2) >> kDropBits << kDropBits; }
/// Of a pixel, in all planes of a layer.
inline constexpr std::uint32_t kMaxDrops = 64;

/// What binder meets in a layer.
///
///   voxel      = pixel pitch along x x pitch along y x thickness of the layer
///   voids      = voxel x (1 - packing)
///   saturation = drops x drop x (1 - evaporates) / voids
/// source  H. Miyanaji, S. Zhang, L. Yang, "A new physics-based model for equilibrium saturation determination in binder
///         jetting additive manufacturing process" (2018), for saturation as binder over voids; the share that evaporates
///         before the next layer is measured by the user
struct Binder {
  double drop_pl = 0;
  double evaporates = 0;  // share of the jetted binder, 0 .. below 1
  double packing = 0.6;   // share of the powder bed that is solid, 0 .. below 1
};

/// Drops a pixel for a saturation, rounded to 2^-24, from shares and picolitres rounded to millionths; all in integers, so
/// that it is the same everywhere. At most `most` drops.
/// percent       0 .. 10^6
/// thickness_nm  of the layer
/// cost          some hundred instructions
Drops24 drops_for(double percent, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm,
                  std::uint32_t maximum = kMaxDrops);

/// drops_for() of many saturations in one layer: the same, but where it is within 2^-30 of a tie. At most 2^20 drops.
class DropScale {
 public:
  DropScale() = default;
  DropScale(const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm);
  /// percent  0 .. 10^6; cost  some instructions
  Drops24 drops(double percent) const;

 private:
  unsigned __int128 of_millionth_ = 0;  // drops of a millionth of the voids, times 2^88
};

/// Volume of the voids of a pixel of a layer, in picolitres.
double voids_pl(const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm);

/// Per cent of the voids that so many drops a pixel fill.
double saturation_of(double drops, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm);

}  // namespace lamina::dose
