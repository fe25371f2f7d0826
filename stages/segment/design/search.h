// stages/segment/design/search.h: the segmented filling that has the pores one wishes for.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "stages/segment/design/limits.h"
#include "stages/segment/design/slots.h"

namespace lamina::segment {

/// What is wished for: one or two of these. A pore is that of predict_pores().
struct PoreTarget {
  std::optional<double> porosity;         // 0 .. 1, all void
  std::optional<double> permeability_m2;  // along z
  std::optional<double> pore_width_mm, pore_length_mm;
};

/// What a better computation says / what slots_of() says, of a plan near the one that is looked for.
struct SlotRatio {
  double porosity = 1, permeability = 1;
};

/// The same of one plan.
struct RatioAt {
  Choice choice;
  SlotRatio ratio;
};

/// How many continuous lines may lie between two segmented ones.
struct LineBounds {
  std::uint32_t minimum = 1, maximum = DesignLimits::kMaxContinuous;
};

struct Design {
  Choice choice;
  SegmentSettings settings;  // its keys
  Segmentation plan;
  Slots slots;  // with the ratios
  SlotRatio ratio;
  Pores pores;
  double miss = 0;    // of the wish that is met worst: relative
  double beyond = 0;  // what was measured: length of DesignLimits::beyond()
};

/// The largest relative miss of what a plan is.
double miss_of(const PoreTarget& target, const Slots& slots, const Pores& pores);

/// Of all choices within the limits that meet the wish the one nearest to what was measured; where none does, the one that
/// misses it least (sum of squared logarithms). Nothing is random: least squares (Levenberg and Marquardt, within bounds)
/// from a grid of beginnings for each number of continuous lines.
/// wish    at least one; positive
/// ratio   of plans far from all that are known; near to these the ratio is theirs: a mean of logarithms, weighted with inverse
///         squares of distances (D. Shepard, "A two-dimensional interpolation function for irregularly-spaced data", Proc. 23rd
///         ACM National Conference, 1968)
/// source  K. Levenberg, "A method for the solution of certain non-linear problems in least squares", Q. Appl. Math. 2 (1944)
/// cost    some 10,000 calls of slots_of(), a fifth of a second
Design search(const PoreTarget& target, const DesignLimits& limits, const SlotRatio& ratio, const LineBounds& bounds = {},
              std::span<const RatioAt> known = {});

}  // namespace lamina::segment
