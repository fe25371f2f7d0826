#include "stages/segment/permeability.h"

#include <fmt/format.h>

#include <cmath>

namespace lamina::segment {

Result<std::vector<FlowPoint>> expanded(std::span<const FlowPoint> points, double length_m, const GasPressures& pressures) {
  std::vector<FlowPoint> gas(points.begin(), points.end());
  for (FlowPoint& point : gas) {
    const double drop = point.gradient_pa_m * length_m, inlet = pressures.outlet_pa + drop;
    if (!(inlet > 0)) {
      return Error{Fault::kInput, fmt::format("a drop of {:.4g} Pa from an outlet at {:.6g} Pa leaves no pressure at the inlet",
                                              drop, pressures.outlet_pa)};
    }
    point.gradient_pa_m *= (inlet + pressures.outlet_pa) / (2 * pressures.reference_pa);
  }
  return gas;
}

Result<Permeability> fit_permeability(std::span<const FlowPoint> points, const Fluid& fluid) {
  if (points.size() < 3) return Error{Fault::kInput, fmt::format("{} points; a fit needs three or more", points.size())};
  // Velocities in units of their largest, so that both columns are of one size.
  double unit = 0, mean = 0;
  for (const FlowPoint& p : points) {
    unit = std::max(unit, std::abs(p.velocity_m_s));
    mean += p.gradient_pa_m;
  }
  mean /= static_cast<double>(points.size());
  if (!(unit > 0)) return Error{Fault::kInput, "all velocities are 0"};
  double s2 = 0, s3 = 0, s4 = 0, t1 = 0, t2 = 0;
  for (const FlowPoint& p : points) {
    const double v = p.velocity_m_s / unit, y = p.gradient_pa_m;
    s2 += v * v;
    s3 += v * v * v;
    s4 += v * v * v * v;
    t1 += v * y;
    t2 += v * v * y;
  }
  const double determinant = s2 * s4 - s3 * s3;
  if (!(determinant > 1e-12 * s2 * s4)) {
    return Error{Fault::kInput,
                 "all points have one velocity; linear and quadratic parts cannot be told apart, measure at more flows"};
  }
  const double a = (t1 * s4 - t2 * s3) / determinant, b = (t2 * s2 - t1 * s3) / determinant;
  double squares = 0, total = 0;
  for (const FlowPoint& p : points) {
    const double v = p.velocity_m_s / unit, miss = p.gradient_pa_m - a * v - b * v * v;
    squares += miss * miss;
    total += (p.gradient_pa_m - mean) * (p.gradient_pa_m - mean);
  }
  const double variance = squares / static_cast<double>(points.size() - 2);
  Permeability result;
  result.linear = a / unit;
  result.quadratic = b / (unit * unit);
  if (!(result.linear > 0) || !(result.quadratic > 0)) {
    return Error{Fault::kInput,
                 fmt::format("the parabola has a {} part that is not positive ({:.4g}); the flow may be too low or too high "
                             "for this equation, or a column is wrong",
                             result.linear > 0 ? "quadratic" : "linear", result.linear > 0 ? result.quadratic : result.linear)};
  }
  result.k1_m2 = fluid.viscosity_pa_s / result.linear;
  result.k2_m = fluid.density_kg_m3 / result.quadratic;
  result.k1_error_m2 = result.k1_m2 * std::sqrt(variance * s4 / determinant) / a;
  result.k2_error_m = result.k2_m * std::sqrt(variance * s2 / determinant) / b;
  result.r_squared = total > 0 ? 1 - squares / total : 1;
  result.scatter_pa_m = std::sqrt(variance);
  return result;
}

}  // namespace lamina::segment
