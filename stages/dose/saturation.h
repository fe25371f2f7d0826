// stages/dose/saturation.h: drops a pixel for a share of the voids to be filled with binder, and the targets that layers have.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"

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

/// The core is as the shell if none is stated.
struct DoseTarget {
  Saturation percent;
  std::optional<Saturation> core_percent;
  const Saturation& of_core() const { return core_percent ? *core_percent : percent; }
  bool has_formula() const { return !percent.formula.empty() || !of_core().formula.empty(); }
  bool operator==(const DoseTarget&) const = default;
};

/// Another target between two heights above the bed, in mm; the last one that contains a layer's plane counts.
struct DoseTargetRange {
  double from_mm = 0, to_mm = 0;
  DoseTarget target;
};

struct DoseTargets {
  DoseTarget all;
  std::vector<DoseTargetRange> ranges;
  std::vector<std::optional<DoseTarget>> own = {};  // of zones 1, 2, ...: at all heights; none: as zone 0

  std::uint32_t zones() const { return static_cast<std::uint32_t>(own.size()) + 1; }
  /// For a layer, by its plane: 0 for that of all, 1 for the first range, ..., behind them those of zones.
  std::size_t target_index(const Layer& layer, std::uint32_t zone = 0) const;
  const DoseTarget& of(const Layer& layer, std::uint32_t zone = 0) const {
    const std::size_t position = target_index(layer, zone);
    if (position > ranges.size()) return *own[position - ranges.size() - 1];
    return position == 0 ? all : ranges[position - 1].target;
  }
  /// Whether a layer's target is one of a part, whose formulas count from the part's corner.
  bool is_own(std::uint32_t zone) const { return zone > 0 && own[zone - 1].has_value(); }
  /// Whether any is a formula.
  bool has_formula() const;
  /// Whether shell and core differ anywhere.
  bool has_core() const;
};

/// What a layer gets, of numbers: of a formula 0.
struct LayerDose {
  Drops24 shell = 0, core = 0;                        // a pixel, at most as many as may be jetted
  Drops24 requested_shell = 0, requested_inside = 0;  // however many
  double requested = 0, requested_core = 0;           // per cent
  double gets = 0, gets_core = 0;                     // per cent, by these drops
  std::uint32_t maximum() const {                     // drops of any pixel
    return static_cast<std::uint32_t>((std::max(shell, core) + kOneDrop - 1) >> kDropBits);
  }
};

/// Of a layer without a target: a drop a pixel, or so many.
inline LayerDose one_drop(std::uint32_t drops = 1) {
  LayerDose dose;
  dose.shell = dose.core = dose.requested_shell = dose.requested_inside = Drops24{drops} << kDropBits;
  return dose;
}

/// most  drops a pixel, 1 .. kMaxDrops; of numbers
LayerDose dose_of(const Layer& layer, const DoseTargets& targets, const Binder& binder, const PixelGrid& grid,
                  std::uint32_t maximum, std::uint32_t zone = 0);

/// Drops rounded to whole ones, half of one to one, and what they give: as a job without dithering jets them.
void round_drops(LayerDose& dose, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm);

}  // namespace lamina::dose
