#include "stages/segment/design.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/geometry/bead_section.h"
#include "stages/geometry/least_squares.h"
#include "stages/segment/segmentation.h"

namespace lamina::segment {
namespace {

constexpr double kThinSpeed = 200;  // %: that of repeated segments
constexpr double kReached = 0.77;   // of a speed; a stretch that reaches less than 0.75 is warned of
constexpr double kMinPoreLength = 0.3, kMinPore = 0.03;
constexpr Interval kThick{1.0, 2.4}, kGap{-0.02, 0.0195};
constexpr double kMinThin = 1.0;
// Di Nisio 2022, Tables 7 and 8: lengths, and what the spacings leave between the widths of Tables 13 to 15.
constexpr Interval kMeasuredThick{1.5, 1.5}, kMeasuredThin{1.5, 2.0}, kMeasuredGap{0, 0.01};

}  // namespace

Result<DesignLimits> DesignLimits::of(const Extruder& machine, const Calibration& calibration) {
  if (calibration.repeated.empty())
    return Error{Fault::kUsage, "its calibration has no widths of repeated segments; measure them with lamina calibrate"};
  for (const Calibration::Repeated& row : calibration.repeated) {
    if (std::abs(row.thin_speed_percent - kThinSpeed) > 0.5)
      return Error{Fault::kUsage, "its calibration has widths of repeated segments at other speeds than 200 %"};
  }
  DesignLimits limits;
  limits.calibration_ = &calibration;
  limits.extrusion_ = {calibration.repeated.front().extrusion_percent, calibration.repeated.back().extrusion_percent};
  const auto& material = machine.material;
  const double full = bead_area(calibration.width_mm, calibration.height_mm, material.shape()) * material.flow;
  limits.full_mm2_ = full;
  limits.continuous_mm_ = bead_width(full, calibration.height_mm,
                                     material.shape() == BeadShape::kEllipse ? BeadShape::kEllipse : BeadShape::kStadium);
  limits.speed_mm_s_ = calibration.speed_mm_s;
  limits.acceleration_ = machine.speed.acceleration_mm_s2;
  limits.max_thin_ = calibration.by_speed.empty() ? 2.0 : stable_distance(calibration, kThinSpeed).value / 2;
  for (const double extrusion : {limits.extrusion_.minimum, limits.extrusion_.maximum}) {
    const Choice minimum = limits.nearest({1, extrusion, kThick.minimum, 0, 0});
    if (minimum.thin_mm > limits.max_thin_)
      return Error{Fault::kUsage, "it accelerates too slowly: thin segments end before they have reached their speed"};
  }
  return limits;
}

Choice DesignLimits::nearest(Choice choice) const {
  choice.continuous = std::clamp<std::uint32_t>(choice.continuous, 1, kMaxContinuous);
  choice.extrusion = extrusion_.near(choice.extrusion);
  const RepeatedReading widths = repeated_at(*calibration_, choice.extrusion);
  // From the thick speed up and down again: v^2 = v0^2 + a s.
  const double fast = kReached * kThinSpeed / 100 * speed_mm_s_, slow = widths.thick_speed_percent / 100 * speed_mm_s_;
  const double starts = acceleration_ > 0 ? (fast * fast - slow * slow) / acceleration_ : 0;
  const double min_thin = std::max({kMinThin, starts, widths.thick_mm + kMinPoreLength});
  choice.thin_mm = std::max(std::min(choice.thin_mm, max_thin_), min_thin);
  choice.thick_mm = kThick.near(choice.thick_mm);
  choice.gap_mm = kGap.near(std::max(choice.gap_mm, kMinPore - (widths.thick_mm - widths.thin_mm) / 2));
  return choice;
}

SegmentSettings DesignLimits::settings_of(const Choice& choice, bool exact) const {
  const auto written = [&](double value, double steps) { return exact ? value : std::round(value * steps) / steps; };
  SegmentSettings settings;
  settings.on = true;
  settings.continuous = choice.continuous;
  settings.thick_extrusion = written(choice.extrusion, 10);
  settings.thick_mm = written(choice.thick_mm, 1000);
  settings.thin_mm = written(choice.thin_mm, 1000);
  settings.thin_speed = kThinSpeed;
  const RepeatedReading widths = repeated_at(*calibration_, settings.thick_extrusion);
  settings.thick_speed = written(widths.thick_speed_percent, 10);
  const Spacing spacing = spacing_for(widths.thick_mm, widths.continuous_mm, choice.gap_mm);
  settings.spacing_sc_mm = written(spacing.segmented, 10'000);
  settings.spacing_cc_mm = written(widths.continuous_mm, 10'000);
  return settings;
}

Result<Segmentation> DesignLimits::plan_of(const SegmentSettings& settings) const {
  return resolve(settings, *calibration_, calibration_->width_mm);
}

Segmentation DesignLimits::deposited(Segmentation plan) const {
  plan.continuous_width_mm = continuous_mm_;
  return plan;
}

double DesignLimits::fed_porosity(const Segmentation& plan) const {
  const double across = 2 * plan.spacing_sc_mm + (plan.continuous - 1.0) * plan.spacing_cc_mm;
  return 1 - full_mm2_ * (plan.thick_extrusion / 100 + plan.continuous) / (across * calibration_->height_mm);
}

std::array<double, 4> DesignLimits::beyond(const Choice& choice) const {
  const auto outside = [](const Interval& measured, double value, double far) { return (value - measured.near(value)) / far; };
  double row = INFINITY;
  for (const Calibration::Repeated& measured : calibration_->repeated)
    row = std::min(row, std::abs(choice.extrusion - measured.extrusion_percent));
  return {row / 25, outside(kMeasuredThick, choice.thick_mm, 0.5), outside(kMeasuredThin, choice.thin_mm, 0.5),
          outside(kMeasuredGap, choice.gap_mm, 0.01)};
}

// --- slots

namespace {

constexpr std::size_t kHeights = 32;    // of the upper half of a layer
constexpr std::size_t kPositions = 48;  // of half a thin segment

/// Half of a bead's width at a height above the middle of its layer, mm.
double half_width(double width, double layer, double above) {
  const double round = std::min(width, layer) / 2;
  if (above >= round) return 0;
  return width / 2 - round + std::sqrt(round * round - above * above);
}

/// A gap that changes with the height.
struct Channel {
  double area = 0, resistance = 0;  // sums of gap and of 12 / gap^3
  double minimum = 1e9;

  void add(double gap) {
    gap = std::max(gap, 0.0);
    area += gap;
    resistance += 12 / (gap * gap * gap);  // infinite where it is closed
    minimum = std::min(minimum, gap);
  }
  double mean_gap() const { return area / kHeights; }
  double conductance() const { return kHeights / resistance; }  // mm3: flow of a mm along the line
};

}  // namespace

Slots slots_of(const Segmentation& plan, double layer_mm) {
  std::array<double, kHeights> thick{}, thin{}, available{}, lines{};
  for (std::size_t k = 0; k < kHeights; ++k) {
    const double above = layer_mm / 2 * (static_cast<double>(k) + 0.5) / kHeights;
    const double continuous = half_width(plan.continuous_width_mm, layer_mm, above);
    thick[k] = half_width(plan.thick_width_mm, layer_mm, above);
    thin[k] = half_width(plan.thin_width_mm, layer_mm, above);
    available[k] = plan.spacing_sc_mm - continuous;
    lines[k] = plan.spacing_cc_mm - 2 * continuous;
  }
  double area = 0, flow = 0;  // mm2 and mm4 of one period's section
  Slots slots;
  const auto add = [&](const Channel& channel, double length) {
    area += channel.mean_gap() * length;
    flow += channel.conductance() * length;
    slots.throat_mm = std::max(slots.throat_mm, channel.minimum);
  };
  Channel next_to_thick;
  for (std::size_t k = 0; k < kHeights; ++k) next_to_thick.add(available[k] - thick[k]);
  add(next_to_thick, 2 * plan.thick_mm);
  for (std::size_t i = 0; i < kPositions; ++i) {
    const double step = plan.thin_mm / 2 / kPositions, from_end = step * (static_cast<double>(i) + 0.5);
    Channel pore;
    for (std::size_t k = 0; k < kHeights; ++k) {
      const double cap = thick[k] > from_end ? std::sqrt(thick[k] * thick[k] - from_end * from_end) : 0;
      pore.add(available[k] - std::max(thin[k], cap));
    }
    add(pore, 4 * step);
  }
  const double period = plan.thick_mm + plan.thin_mm, between = static_cast<double>(plan.continuous) - 1;
  if (between > 0) {
    Channel bonded;
    for (const double gap : lines) bonded.add(gap);
    add(bonded, between * period);
  }
  const double section = period * (2 * plan.spacing_sc_mm + between * plan.spacing_cc_mm);
  slots.porosity = area / section;
  slots.permeability_m2 = flow / section * 1e-6;
  return slots;
}

// --- what can be reached

namespace {

/// All plans at the ends of what is free, with 1, 2, .. lines.
template <class Take>
void for_each_end(const DesignLimits& limits, const Take& take) {
  const Interval extrusion = limits.extrusion();
  for (std::uint32_t i = 0; i < 24 * DesignLimits::kMaxContinuous; ++i) {
    const double share = i % 3 / 2.0;
    const Choice choice = limits.nearest({i / 24 + 1, extrusion.minimum + share * (extrusion.maximum - extrusion.minimum),
                                          i / 3 % 2 == 0 ? kThick.minimum : kThick.maximum, i / 6 % 2 == 0 ? 0 : INFINITY,
                                          i / 12 % 2 == 0 ? kGap.minimum : kGap.maximum});
    if (const auto plan = limits.plan_of(limits.settings_of(choice))) take(choice, *plan);
  }
}

}  // namespace

std::array<Reach, DesignLimits::kMaxContinuous> reach_of(const DesignLimits& limits) {
  std::array<Reach, DesignLimits::kMaxContinuous> all;
  const auto widen = [](Interval& interval, double value) {
    interval = {std::min(interval.minimum, value), std::max(interval.maximum, value)};
  };
  for_each_end(limits, [&](const Choice& choice, const Segmentation& plan) {
    Reach& reach = all[choice.continuous - 1];
    const Slots slots = slots_of(limits.deposited(plan), limits.calibration().height_mm);
    const Pores pores = predict_pores(plan);
    if (slots.permeability_m2 < reach.permeability_m2.minimum) reach.tightest = choice;
    if (slots.permeability_m2 > reach.permeability_m2.maximum) reach.widest = choice;
    widen(reach.permeability_m2, slots.permeability_m2);
    widen(reach.porosity, limits.fed_porosity(plan));
    widen(reach.pore_width_mm, pores.width_mm);
    widen(reach.pore_length_mm, pores.length_mm);
  });
  return all;
}

std::vector<RatioAt> fed_ratios(const DesignLimits& limits, double permeability) {
  std::vector<RatioAt> all;
  for_each_end(limits, [&](const Choice& choice, const Segmentation& plan) {
    const Slots slots = slots_of(limits.deposited(plan), limits.calibration().height_mm);
    all.push_back({choice, {limits.fed_porosity(plan) / slots.porosity, permeability}});
  });
  return all;
}

bool out_of_reach(const PoreTarget& target, std::span<const Reach> reach) {
  const auto far = [](const std::optional<double>& value, const Interval& interval, double factor) {
    return value && (*value * factor < interval.minimum || *value > interval.maximum * factor);
  };
  return !reach.empty() && std::ranges::all_of(reach, [&](const Reach& lines) {
    return far(target.porosity, lines.porosity, 1.15) || far(target.permeability_m2, lines.permeability_m2, 1.5) ||
           far(target.pore_width_mm, lines.pore_width_mm, 1.15) || far(target.pore_length_mm, lines.pore_length_mm, 1.15);
  });
}

// --- the search

namespace {

constexpr std::size_t kFree = 4, kResiduals = 8;  // four of targets, four of the distance to what was measured
constexpr double kExact = 1e-3;                   // a target missed by so much weighs as much as a length that is far off
constexpr double kMet = 5e-3;                     // of targets; less than the effect of rounding the keys
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

/// Logarithms of a plan's values over the targets; 0 where there is no target.
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

  Residuals residuals(const Choice& choice) const {
    const Result<Segmentation> plan = limits_.plan_of(limits_.settings_of(choice, true));
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

/// Whether one meets the target better than another: both do so, and it is nearer to what was measured.
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

// --- regions

namespace {

/// Of DesignLimits::beyond(), whose 1 is far: with fewer continuous lines k1 is surer, for more of the void leads through.
constexpr double kHardlyFarther = 0.5;

/// Heights are written to a nanometre.
double end_of(double layer, double layer_mm) { return std::round(layer * layer_mm * 1e6) / 1e6; }

Status check(const std::vector<double>& tops, double layer_mm) {
  double below = 0;
  for (const double top : tops) {
    if (top < below + layer_mm / 2)
      return Error{Fault::kUsage, fmt::format("{:.4g} mm is not above {:.4g} mm; name the lowest first", top, below)};
    if (top - below < (kMinLayers - 0.5) * layer_mm)
      return Error{Fault::kUsage, fmt::format("{:.4g} to {:.4g} mm is less than {} layers of {:g} mm; make regions higher",
                                              below, top, kMinLayers, layer_mm)};
    below = top;
  }
  return {};
}

double last_layer(double height_mm, double layer_mm) { return std::ceil(height_mm / layer_mm - 1e-6); }

}  // namespace

Result<std::vector<double>> equal_tops(double height_mm, std::uint32_t steps, double layer_mm) {
  const double layers = last_layer(height_mm, layer_mm);
  if (layers < steps)
    return Error{Fault::kUsage, fmt::format("{} regions of {:g} mm have less than {} layers of {:g} mm each; give fewer", steps,
                                            height_mm, kMinLayers, layer_mm)};
  std::vector<double> tops;
  for (std::uint32_t i = 1; i <= steps; ++i) tops.push_back(end_of(std::floor(layers * i / steps + 1e-9), layer_mm));
  if (const Status status = check(tops, layer_mm); !status) return status.error();
  return tops;
}

Result<std::vector<double>> whole_tops(const std::vector<double>& tops_mm, double layer_mm) {
  if (tops_mm.size() < 2) return Error{Fault::kUsage, "one region has no gradient; name the tops of two or more"};
  if (tops_mm.size() > kMaxRegions)
    return Error{Fault::kUsage, fmt::format("{} regions are more than {}", tops_mm.size(), kMaxRegions)};
  std::vector<double> tops;
  for (const double top : tops_mm) tops.push_back(end_of(std::round(top / layer_mm), layer_mm));
  tops.back() = end_of(last_layer(tops_mm.back(), layer_mm), layer_mm);
  if (const Status status = check(tops, layer_mm); !status) return status.error();
  return tops;
}

std::vector<TargetStep> steps_of(const PoreTarget& bottom, const PoreTarget& top, const std::vector<double>& tops_mm) {
  std::vector<TargetStep> steps;
  double below = 0;
  for (const double end : tops_mm) {
    steps.push_back({below, end, {}});
    below = end;
  }
  const auto middle = [](const TargetStep& step) { return (step.from_mm + step.to_mm) / 2; };
  const double low = middle(steps.front()), way = middle(steps.back()) - low;
  for (TargetStep& step : steps) {
    const double share = way > 0 ? (middle(step) - low) / way : 0;
    for (const auto value :
         {&PoreTarget::porosity, &PoreTarget::permeability_m2, &PoreTarget::pore_width_mm, &PoreTarget::pore_length_mm}) {
      const std::optional<double>&low_value = bottom.*value, &high_value = top.*value;
      if (low_value && high_value) step.target.*value = *low_value + share * (*high_value - *low_value);
    }
  }
  return steps;
}

std::uint32_t common_lines(const std::vector<TargetStep>& steps, const DesignLimits& limits, const SlotRatio& ratio,
                           double tolerance) {
  constexpr std::uint32_t kMax = DesignLimits::kMaxContinuous;
  std::array<std::uint32_t, kMax + 1> met{};
  std::array<double, kMax + 1> beyond{};
  std::uint32_t reachable = 0;
  for (const TargetStep& step : steps) {
    bool any = false;
    for (std::uint32_t lines = 1; lines <= kMax; ++lines) {
      const Design design = search(step.target, limits, ratio, {lines, lines});
      if (design.miss > tolerance) continue;
      any = true;
      ++met[lines];
      beyond[lines] = std::max(beyond[lines], design.beyond);
    }
    if (any) ++reachable;
  }
  std::uint32_t best = 0;
  for (std::uint32_t lines = 1; lines <= kMax && reachable > 0; ++lines) {
    if (met[lines] == reachable && (best == 0 || beyond[lines] < beyond[best] - kHardlyFarther)) best = lines;
  }
  return best;
}

}  // namespace lamina::segment
