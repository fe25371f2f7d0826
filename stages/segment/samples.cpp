#include "stages/segment/samples.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace lamina::segment {

Spread spread_of(const std::vector<double>& values) {
  Spread spread;
  const auto count = static_cast<double>(values.size());
  for (const double value : values) spread.mean += value / count;
  if (values.size() < 2) return spread;
  // In units of the mean: squares of permeabilities in m2 would leave the range of numbers.
  double squares = 0;
  for (const double value : values) squares += (value / spread.mean - 1) * (value / spread.mean - 1);
  spread.deviation = spread.mean * std::sqrt(squares / (count - 1));
  spread.mean_error = spread.deviation / std::sqrt(count);
  return spread;
}

Result<GroupFit> fit_group(const FlowGroup& group, const Fluid& fluid) {
  GroupFit result;
  const Result<Permeability> pooled = fit_permeability(group.points, fluid);
  if (!pooled) return pooled.error();
  result.pooled = *pooled;
  if (group.samples.size() < 2) return result;
  std::vector<std::vector<FlowPoint>> points(group.samples.size());
  for (const FlowPoint& point : group.points) points[point.sample].push_back(point);
  std::vector<double> k1, k2;
  for (std::size_t s = 0; s < points.size(); ++s) {
    const Result<Permeability> fit = fit_permeability(points[s], fluid);
    if (!fit) {
      result.left_out.push_back(group.samples[s] + ": " + fit.error().message);
      continue;
    }
    result.samples.push_back({group.samples[s], points[s].size(), *fit});
    k1.push_back(fit->k1_m2);
    k2.push_back(fit->k2_m);
  }
  if (k1.empty()) return result;
  result.k1_m2 = spread_of(k1);
  result.k2_m = spread_of(k2);
  return result;
}

Result<std::vector<DropsFit>> fit_drops(const std::string& path, const DropsSettings& settings) {
  auto groups = read_flows(path, settings.medium);
  if (!groups) return groups.error();
  std::vector<DropsFit> fits;
  for (FlowGroup& group : *groups) {
    DropsFit& fit = fits.emplace_back();
    fit.group = std::move(group);
    fit.pressures = settings.gas;
    const std::string position = fit.group.name.empty() ? "" : fit.group.name + ": ";
    const auto at = [&](const Error& error) {
      return Error{error.fault, fmt::format("{}: {}{}", path, position, error.message)};
    };
    const auto take = [&](const char* form, Result<GroupFit> found, std::optional<GroupFit>& target) {
      target = std::move(*found);
      for (const std::string& line : target->left_out)
        fit.warnings.push_back(fmt::format("{}{}{}; left out of the mean", position, form, line));
    };
    Result<GroupFit> plain = fit_group(fit.group, settings.fluid);
    if (!plain && !settings.gas) return at(plain.error());
    // Of a gas at large drops the plain parabola may bend the wrong way; that of gases does not.
    if (plain)
      take("", std::move(plain), fit.plain);
    else
      fit.warnings.push_back(fmt::format("{}as if it did not expand: {}", position, plain.error().message));
    if (!settings.gas) continue;
    fit.expanded = fit.group;
    auto points = expanded(fit.group.points, settings.medium.length_m, *settings.gas);
    if (!points) return at(points.error());
    fit.expanded.points = std::move(*points);
    Result<GroupFit> gas = fit_group(fit.expanded, settings.fluid);
    if (!gas) return at(gas.error());
    take("compressible: ", std::move(gas), fit.gas);
  }
  return fits;
}

}  // namespace lamina::segment
