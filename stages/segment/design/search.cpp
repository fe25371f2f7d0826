#include "stages/segment/design/search.h"

#include <algorithm>
#include <cmath>

#include "stages/geometry/least_squares.h"

namespace lamina::segment {
namespace {

constexpr std::size_t kFree = 4, kResiduals = 8;  // four of wishes, four of the way to what was measured
constexpr double kExact = 1e-3;                   // a wish that is missed by so much weighs as much as a length that is far off
constexpr double kMet = 5e-3;                     // of wishes; less than what rounding the keys does
constexpr int kSteps = 30;

using Residuals = std::array<double, kResiduals>;
using Free = std::array<double, kFree>;

/// Units of what is free, so that 1 is about as far in each.
constexpr std::array<double, kFree> kUnit{25, 0.5, 0.5, 0.01};

Free free_of(const Choice& choice) {
  return {choice.extrusion / kUnit[0], choice.thick_mm / kUnit[1], choice.thin_mm / kUnit[2], choice.gap_mm / kUnit[3]};
}

Choice choice_of(const Free& at, std::uint32_t continuous) {
  return {continuous, at[0] * kUnit[0], at[1] * kUnit[1], at[2] * kUnit[2], at[3] * kUnit[3]};
}

template <std::size_t N>
double squares_of(const std::array<double, N>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return sum;
}

/// Logarithms of what a plan is, over what is wished; 0 where nothing is.
std::array<double, 4> misses(const PoreTarget& target, const Slots& slots, const Pores& pores) {
  const auto miss = [](const std::optional<double>& requested_range, double is) {
    return requested_range ? std::log(std::max(is, 1e-30) / *requested_range) : 0.0;
  };
  return {miss(target.porosity, slots.porosity), miss(target.permeability_m2, slots.permeability_m2),
          miss(target.pore_width_mm, pores.width_mm), miss(target.pore_length_mm, pores.length_mm)};
}

class RatioSearch {
 public:
  RatioSearch(const PoreTarget& target, const DesignLimits& limits, const SlotRatio& ratio, std::span<const RatioAt> known)
      : target_(target), limits_(limits), ratio_(ratio), known_(known), layer_mm_(limits.calibration().height_mm) {}

  SlotRatio ratio_at(const Choice& choice) const {
    const Free here = free_of(choice);
    double weights = kFarWeight, porosity = kFarWeight * std::log(ratio_.porosity),
           permeability = kFarWeight * std::log(ratio_.permeability);
    for (const RatioAt& at : known_) {
      const double lines = static_cast<double>(choice.continuous) - at.choice.continuous;
      Free way = free_of(at.choice);
      for (std::size_t i = 0; i < kFree; ++i) way[i] -= here[i];
      const double weight = 1 / (squares_of(way) + lines * lines + kSamePlan);
      weights += weight;
      porosity += weight * std::log(at.ratio.porosity);
      permeability += weight * std::log(at.ratio.permeability);
    }
    return {std::exp(porosity / weights), std::exp(permeability / weights)};
  }

  Slots corrected(const Segmentation& plan, const SlotRatio& ratio) const {
    Slots slots = slots_of(limits_.deposited(plan), layer_mm_);
    slots.porosity *= ratio.porosity;
    slots.permeability_m2 *= ratio.permeability;
    return slots;
  }

  /// The least sum of squares that is found from a beginning.
  Choice descend(Choice begin) const {
    const std::uint32_t lines = begin.continuous;
    Choice best = limits_.nearest(begin);
    Free at = free_of(best);
    Residuals here = residuals(best);
    double damping = 1e-2;
    for (int step = 0; step < kSteps && damping < 1e8; ++step) {
      std::array<Free, kResiduals> slope{};
      for (std::size_t i = 0; i < kFree; ++i) {
        // Away from a bound that lies ahead.
        Free aside = at;
        aside[i] += kAside;
        Choice moved = limits_.nearest(choice_of(aside, lines));
        if (std::abs(free_of(moved)[i] - at[i]) < kAside / 2) {
          aside[i] = at[i] - kAside;
          moved = limits_.nearest(choice_of(aside, lines));
        }
        const double way = free_of(moved)[i] - at[i];
        if (std::abs(way) < kAside / 2) continue;
        const Residuals there = residuals(moved);
        for (std::size_t k = 0; k < kResiduals; ++k) slope[k][i] = (there[k] - here[k]) / way;
      }
      LeastSquares linear(kFree);
      for (std::size_t k = 0; k < kResiduals; ++k) linear.add(slope[k], -here[k]);
      for (; damping < 1e8; damping *= 6) {
        LeastSquares damped = linear;
        damped.damp(damping, damping * 1e-6);
        Free change{};
        if (!damped.solve(change)) continue;
        for (std::size_t i = 0; i < kFree; ++i) change[i] += at[i];
        const Choice tried = limits_.nearest(choice_of(change, lines));
        const Residuals there = residuals(tried);
        if (squares_of(there) >= squares_of(here) * (1 - 1e-9)) continue;
        best = tried;
        at = free_of(tried);
        here = there;
        damping = std::max(damping / 10, 1e-9);
        break;
      }
    }
    return best;
  }

  Design design_of(const Choice& choice) const {
    Design design;
    design.choice = choice;
    design.settings = limits_.settings_of(choice);
    if (const Result<Segmentation> plan = limits_.plan_of(design.settings)) design.plan = *plan;
    design.ratio = ratio_at(choice);
    design.slots = corrected(design.plan, design.ratio);
    design.pores = predict_pores(design.plan);
    design.miss = miss_of(target_, design.slots, design.pores);
    for (const double part : limits_.beyond(choice)) design.beyond += part * part;
    design.beyond = std::sqrt(design.beyond);
    return design;
  }

 private:
  static constexpr double kAside = 1e-3;
  static constexpr double kFarWeight = 0.1, kSamePlan = 1e-3;  // in units of what is free

  /// Not rounded to what is written.
  Residuals residuals(const Choice& choice) const {
    SegmentSettings settings = limits_.settings_of(choice);
    settings.thick_extrusion = choice.extrusion;
    settings.thick_mm = choice.thick_mm;
    settings.thin_mm = choice.thin_mm;
    const RepeatedReading widths = repeated_at(limits_.calibration(), choice.extrusion);
    settings.spacing_sc_mm = spacing_for(widths.thick_mm, widths.continuous_mm, choice.gap_mm).segmented;
    settings.spacing_cc_mm = widths.continuous_mm;
    const Result<Segmentation> plan = limits_.plan_of(settings);
    Residuals all;
    all.fill(1e6);
    if (!plan) return all;
    const auto requested_range = misses(target_, corrected(*plan, ratio_at(choice)), predict_pores(*plan));
    const auto beyond = limits_.beyond(choice);
    for (std::size_t i = 0; i < 4; ++i) {
      all[i] = requested_range[i] / kExact;
      all[4 + i] = beyond[i];
    }
    return all;
  }

  const PoreTarget& target_;
  const DesignLimits& limits_;
  SlotRatio ratio_;
  std::span<const RatioAt> known_;
  double layer_mm_;
};

/// Whether one meets the wish better than another: both do so, and it is nearer to what was measured.
bool better(const Design& one, const Design& other) {
  if (one.miss <= kMet && other.miss <= kMet) return one.beyond < other.beyond - 1e-3;
  return one.miss < other.miss - 1e-9;
}

}  // namespace

double miss_of(const PoreTarget& target, const Slots& slots, const Pores& pores) {
  double worst = 0;
  for (const double miss : misses(target, slots, pores)) worst = std::max(worst, std::abs(std::expm1(miss)));
  return worst;
}

Design search(const PoreTarget& target, const DesignLimits& limits, const SlotRatio& ratio, const LineBounds& bounds,
              std::span<const RatioAt> known) {
  const RatioSearch finder(target, limits, ratio, known);
  const Interval extrusion = limits.extrusion();
  std::optional<Design> best;
  for (std::uint32_t lines = bounds.minimum; lines <= bounds.maximum; ++lines) {
    for (const double share : {0.5, 0.0, 1.0}) {
      for (const double thick : {1.5, 1.1, 2.2}) {
        const double percent = extrusion.minimum + share * (extrusion.maximum - extrusion.minimum);
        const Design design = finder.design_of(finder.descend({lines, percent, thick, 1.6, 0.005}));
        if (!best || better(design, *best)) best = design;
      }
    }
  }
  return *best;
}

}  // namespace lamina::segment
