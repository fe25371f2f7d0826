#include "pipeline/calibrate/pore_page.h"

#include <fmt/format.h>

#include "stages/data/text/json.h"
#include "stages/data/text/readable.h"
#include "stages/segment/permeability.h"  // the unit

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

nlohmann::ordered_json as_json(const WindowChoice& choice, const PoreReport& report) {
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

}  // namespace lamina::pipeline
