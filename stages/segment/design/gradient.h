// stages/segment/design/gradient.h: wishes that change from the bottom of a part to its top, as regions one above the other.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/status.h"
#include "stages/segment/design/search.h"

namespace lamina::segment {

/// One region of a filling.
struct TargetStep {
  double from_mm = 0, to_mm = 0;  // above the part's bottom; ends of layers
  PoreTarget target;
};

/// A region has so many layers at least: where two of them meet, pores lie upon each other only in part.
inline constexpr std::uint32_t kMinLayers = 3;
inline constexpr std::uint32_t kMaxRegions = 50;

/// The tops of regions as high as each other, up to whole layers; the last one ends with the layer that reaches the height.
/// steps   2 or more
/// errors  kUsage: some would have less than kMinLayers
Result<std::vector<double>> equal_tops(double height_mm, std::uint32_t steps, double layer_mm);

/// The same for tops that are given: each is moved to the nearest end of a layer, the last one up.
/// errors  kUsage: less than two, more than kMaxRegions, or not kMinLayers above the one before
Result<std::vector<double>> whole_tops(const std::vector<double>& tops_mm, double layer_mm);

/// The wish of each region: the bottom's in the first, the top's in the last, and between them in proportion to the heights of
/// the regions' middles.
/// bottom, top  wish for the same things
/// tops_mm      of equal_tops() or whole_tops()
std::vector<TargetStep> steps_of(const PoreTarget& bottom, const PoreTarget& top, const std::vector<double>& tops_mm);

/// The least number of continuous lines with which slots meet the wish of every region that any number meets, unless a larger
/// one is much nearer to what was measured. With one number, pores of neighbouring regions lie in rows of about the same
/// distance. 0: there is none.
/// tolerance  relative
/// cost       of search(), for each step
std::uint32_t common_lines(const std::vector<TargetStep>& steps, const DesignLimits& limits, const SlotRatio& ratio,
                           double tolerance);

}  // namespace lamina::segment
