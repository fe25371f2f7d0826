#include "pipeline/pores/pore_page.h"

#include <fmt/format.h>

#include "stages/segment/permeability.h"  // the unit
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

std::string as_text(const WindowChoice& choice, const PoreReport& report) {
  const Box& box = choice.window.box;
  const auto& repeats = choice.window.periodic;
  std::string axes;
  for (std::size_t a = 0; a < 3; ++a)
    if (repeats[a]) axes += axes.empty() ? std::string(1, "xyz"[a]) : fmt::format(", {}", "xyz"[a]);
  std::string text =
      fmt::format("window    {:.3f} x {:.3f} x {:.3f} mm around {:.2f}, {:.2f} mm, {} from layer {} on; repeats along {}\n",
                  mm(box.width()), mm(box.depth()), mm(box.height()), mm(box.middle().x), mm(box.middle().y),
                  choice.layers == 1 ? "one layer" : fmt::format("{} layers", choice.layers), choice.first_layer,
                  axes.empty() ? "no axis: walls close its sides" : axes);
  const auto& count = choice.window.count;
  text += fmt::format("voxels    {} x {} x {}, {} of void\n", count[0], count[1], count[2], readable_count(report.empty));
  text += fmt::format("porosity  {:.2f} %, {:.2f} % leads through along z\n", 100 * report.porosity.total(),
                      100 * report.porosity.percolating(2));
  text += fmt::format("surface   {:.2f} mm2 a mm3\n", report.surface_per_mm);
  for (std::size_t a = 0; a < 3; ++a) {
    if (!report.flow[a]) continue;
    const Darcy& darcy = *report.flow[a];
    const double k = darcy.k_m2[a] / segment::kDarcy, error = darcy.error_m2[a] / segment::kDarcy;
    if (darcy.steps == 0) {
      text += fmt::format("along {}   k1 0 D: no void leads through\n", "xyz"[a]);
      continue;
    }
    text += fmt::format("along {}   k1 {:.4g} +- {:.2g} D ({:.4e} m2), tortuosity {:.3f}, throat {:.3f} mm\n", "xyz"[a], k,
                        error, darcy.k_m2[a], darcy.tortuosity, report.throat_mm[a]);
  }
  return text;
}

Json as_json(const WindowChoice& choice, const PoreReport& report) {
  const Box& box = choice.window.box;
  Json json = {
      {"command", "permeability"},
      {"window_mm", {mm(box.width()), mm(box.depth()), mm(box.height())}},
      {"repeats", choice.window.periodic},
      {"voxels", choice.window.count},
      {"void_voxels", report.empty},
      {"porosity", report.porosity.total()},
      {"porosity_through", {report.porosity.percolating(0), report.porosity.percolating(1), report.porosity.percolating(2)}},
      {"surface_per_mm", report.surface_per_mm},
      {"throat_mm", report.throat_mm},
      {"flow", Json::array()}};
  for (std::size_t a = 0; a < 3; ++a) {
    if (!report.flow[a]) continue;
    const Darcy& darcy = *report.flow[a];
    json["flow"].push_back({{"along", std::string(1, "xyz"[a])},
                            {"k1_m2", darcy.k_m2},
                            {"k1_error_m2", darcy.error_m2},
                            {"k1_darcy", darcy.k_m2[a] / segment::kDarcy},
                            {"k1_error_darcy", darcy.error_m2[a] / segment::kDarcy},
                            {"tortuosity", darcy.tortuosity},
                            {"steps", darcy.steps},
                            {"residual", darcy.residual},
                            {"resolved", darcy.resolved}});
  }
  return json;
}

std::string as_text(const Forchheimer& inertia) {
  const auto reynolds = [&](const segment::FlowPoint& point) { return point.velocity_m_s * inertia.reynolds_per_velocity; };
  return fmt::format(
      "inertia   k2 {:.4g} +- {:.2g} m along z, with k1 {:.4g} D, at pore Reynolds numbers of {:.1f} to {:.1f}{}\n",
      inertia.fit.k2_m, inertia.fit.k2_error_m, inertia.fit.k1_m2 / segment::kDarcy, reynolds(inertia.points.front()),
      reynolds(inertia.points.back()),
      inertia.weak_reynolds > 0 ? fmt::format("; weak, with the cube of the velocity, up to {:.1f}", inertia.weak_reynolds)
                                : "");
}

Json as_json(const Forchheimer& inertia) {
  Json json = {{"along", "z"},
               {"k2_m", inertia.fit.k2_m},
               {"k2_error_m", inertia.fit.k2_error_m},
               {"k1_m2", inertia.fit.k1_m2},
               {"k1_error_m2", inertia.fit.k1_error_m2},
               {"weak_up_to_reynolds", inertia.weak_reynolds},
               {"settled", inertia.settled},
               {"points", Json::array()}};
  for (const segment::FlowPoint& point : inertia.points) {
    json["points"].push_back({{"velocity_m_s", point.velocity_m_s},
                              {"gradient_pa_m", point.gradient_pa_m},
                              {"reynolds", point.velocity_m_s * inertia.reynolds_per_velocity}});
  }
  return json;
}

}  // namespace lamina::pipeline
