#include "stages/segment/design/gradient.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lamina::segment {
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

std::optional<double> between(const std::optional<double>& bottom, const std::optional<double>& top, double share) {
  return bottom && top ? std::optional(*bottom + share * (*top - *bottom)) : std::nullopt;
}

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
    step.target.porosity = between(bottom.porosity, top.porosity, share);
    step.target.permeability_m2 = between(bottom.permeability_m2, top.permeability_m2, share);
    step.target.pore_width_mm = between(bottom.pore_width_mm, top.pore_width_mm, share);
    step.target.pore_length_mm = between(bottom.pore_length_mm, top.pore_length_mm, share);
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
