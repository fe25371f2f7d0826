// stages/dose/dose_target.h: the requested saturation at each height, and the drops that every layer gets for it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/saturation.h"
#include "stages/dose/saturation.h"

namespace lamina::dose {

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
  bool cut = false;                                   // more drops were requested than may be jetted
  std::uint32_t maximum() const {                     // drops of any pixel
    return static_cast<std::uint32_t>(((shell > core ? shell : core) + kOneDrop - 1) >> kDropBits);
  }
};

/// Drops rounded to whole ones, half of one to one, and what they give: as a job without dithering jets them.
void round_drops(LayerDose& dose, const Binder& binder, const PixelGrid& grid, std::int64_t thickness_nm);

/// Of a layer without a target: a drop a pixel, or so many.
inline LayerDose one_drop(std::uint32_t drops = 1) {
  LayerDose dose;
  dose.shell = dose.core = dose.requested_shell = dose.requested_inside = Drops24{drops} << kDropBits;
  return dose;
}

/// most  drops a pixel, 1 .. kMaxDrops; of numbers
LayerDose dose_of(const Layer& layer, const DoseTargets& targets, const Binder& binder, const PixelGrid& grid,
                  std::uint32_t maximum, std::uint32_t zone = 0);

}  // namespace lamina::dose
