#include "pipeline/calibrate/drops_page.h"

#include <fmt/format.h>

namespace lamina::pipeline {
namespace {

using segment::GroupFit;
using segment::kDarcy;
using segment::Permeability;

std::string spread_line(const char* name, const segment::Spread& spread, double unit, const char* unit_name) {
  return fmt::format("  {}  mean {:.4g} +- {:.2g} {}, standard deviation {:.3g} {} ({:.1f} %)\n", name, spread.mean / unit,
                     spread.mean_error / unit, unit_name, spread.deviation / unit, unit_name, 100 * spread.coefficient());
}

std::string lines_of(const GroupFit& fit, std::size_t points) {
  const Permeability& pooled = fit.pooled;
  std::string text = fmt::format(
      "k1   {:.2f} +- {:.2f} D ({:.4e} m2)\nk2   {:.4g} +- {:.2g} m\nfit  R2 {:.6f}, {} points, scatter {:.4g} Pa/m\n",
      pooled.k1_m2 / kDarcy, pooled.k1_error_m2 / kDarcy, pooled.k1_m2, pooled.k2_m, pooled.k2_error_m, pooled.r_squared,
      points, pooled.scatter_pa_m);
  if (fit.samples.size() < 2) return text;
  text += fmt::format("{} samples, each by itself\n", fit.samples.size());
  for (const segment::SampleFit& one : fit.samples) {
    text += fmt::format("  {}  k1 {:.2f} +- {:.2f} D, k2 {:.4g} +- {:.2g} m, R2 {:.6f}, {} points\n", one.name,
                        one.fit.k1_m2 / kDarcy, one.fit.k1_error_m2 / kDarcy, one.fit.k2_m, one.fit.k2_error_m,
                        one.fit.r_squared, one.points);
  }
  return text + spread_line("k1", fit.k1_m2, kDarcy, "D") + spread_line("k2", fit.k2_m, 1, "m");
}

Json coefficients(const Permeability& fit) {
  return {{"k1_darcy", fit.k1_m2 / kDarcy},
          {"k1_error_darcy", fit.k1_error_m2 / kDarcy},
          {"k2_m", fit.k2_m},
          {"k2_error_m", fit.k2_error_m},
          {"r_squared", fit.r_squared},
          {"scatter_pa_m", fit.scatter_pa_m}};
}

Json spread_of(const segment::Spread& spread, double unit) {
  return {{"mean", spread.mean / unit},
          {"deviation", spread.deviation / unit},
          {"mean_error", spread.mean_error / unit},
          {"coefficient_of_variation", spread.coefficient()}};
}

/// Adds the pooled fit, and the samples where there are any.
void add_form(const GroupFit& fit, Json& json) {
  json.update(coefficients(fit.pooled));
  if (fit.samples.size() < 2) return;
  json["samples"] = Json::array();
  for (const segment::SampleFit& one : fit.samples) {
    Json sample = {{"sample", one.name}, {"points", one.points}};
    sample.update(coefficients(one.fit));
    json["samples"].push_back(std::move(sample));
  }
  json["spread"] = {{"k1_darcy", spread_of(fit.k1_m2, kDarcy)}, {"k2_m", spread_of(fit.k2_m, 1)}};
}

}  // namespace

std::string as_text(const segment::DropsFit& fit) {
  std::string text = fit.group.name.empty() ? "" : fit.group.name + "\n";
  if (fit.plain) text += lines_of(*fit.plain, fit.group.points.size());
  if (!fit.gas) return text;
  return text +
         fmt::format("compressible, outlet at {:.6g} Pa, reference pressure of the flow {:.6g} Pa\n", fit.pressures->outlet_pa,
                     fit.pressures->reference_pa) +
         lines_of(*fit.gas, fit.expanded.points.size());
}

Json as_json(const segment::DropsFit& fit) {
  Json json = {{"configuration", fit.group.name}, {"points", fit.group.points.size()}};
  if (fit.plain) add_form(*fit.plain, json);
  if (!fit.gas) return json;
  Json gas = {{"outlet_pa", fit.pressures->outlet_pa}, {"flow_pa", fit.pressures->reference_pa}};
  add_form(*fit.gas, gas);
  json["compressible"] = std::move(gas);
  return json;
}

Plot draw(const segment::DropsFit& fit) {
  return fit.gas ? segment::draw_fit(fit.expanded, fit.gas->pooled, true) : segment::draw_fit(fit.group, fit.plain->pooled);
}

}  // namespace lamina::pipeline
