// Tables that people write: tops of layers, measured widths, flows and pressure drops.
#include <cmath>

#include "pipeline/calibrate/calibrate.h"
#include "stages/heights/evaluate.h"
#include "stages/segment/permeability.h"
#include "stages/segment/pieces.h"
#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

/// A ramp of 2 mm on a plate.
const heights::SurfaceIndex& surface() {
  static const std::vector<Mesh> kMeshes = [] {
    Mesh mesh;
    const Point3 a{0, 0, 0}, b{10'000'000, 0, 0}, c{10'000'000, 5'000'000, 2'000'000}, d{0, 5'000'000, 2'000'000};
    mesh.triangles = {{a, b, c}, {a, c, d}, {{0, 0, 2'000'000}, b, c}};
    for (const Triangle& t : mesh.triangles) {
      for (const Point3& p : {t.a, t.b, t.c}) mesh.bounds.add(p);
    }
    return std::vector<Mesh>{std::move(mesh)};
  }();
  static const heights::SurfaceIndex kIndex = [] {
    const Instance instance{0, {0, 0, 0}};
    const std::uint32_t part = 0;
    return heights::index_surface(kMeshes, std::span(&instance, 1), std::span(&part, 1), 1, {});
  }();
  return kIndex;
}

bool read_heights(std::string_view text) {
  static MemoryFile file("tops.txt");
  heights::Options options;
  options.set.values = {100'000};
  const auto study = heights::study_table(surface(), options, file.hold(text));
  if (!study) return check_error(study.error()), false;
  law(study->layers() > 0 && study->boundaries.front() == 0, "no layer");
  law(std::ranges::adjacent_find(study->boundaries, std::greater_equal{}) == study->boundaries.end(), "tops do not rise");
  law(study->boundaries.back() <= 2'147'000'000, "beyond reach");
  law(study->evaluation.layers.size() == study->layers(), "layers that were not evaluated");
  return true;
}

bool read_widths(std::string_view text) {
  static MemoryFile file("widths.csv");
  const auto rows = segment::read_widths(file.hold(text));
  if (!rows) return check_error(rows.error()), false;
  law(!rows->empty(), "no rows");
  const auto found = segment::calibrate(*rows, {}, "widths.csv");
  if (!found) return check_error(found.error()), true;
  for (const std::string& advice : found->advice) check_line(advice);
  return true;
}

bool read_flows(std::string_view text) {
  static MemoryFile file("flows.csv");
  const auto groups = segment::read_flows(file.hold(text), {0.01, 1e-4});
  if (!groups) return check_error(groups.error()), false;
  law(!groups->empty(), "no groups");
  for (const segment::FlowGroup& group : *groups) {
    const auto fit = segment::fit_permeability(group.points, {});
    if (!fit) {
      check_error(fit.error());
      continue;
    }
    law(fit->k1_m2 > 0 && fit->k2_m > 0 && std::isfinite(fit->k1_m2) && std::isfinite(fit->k2_m), "coefficients");
    segment::draw_fit(group, *fit);
    const auto each = segment::fit_group(group, {});
    law(each.ok() && each->samples.size() + each->left_out.size() <= group.samples.size(), "samples");
    for (const std::string& line : each->left_out) check_line(line);
    for (const segment::FlowPoint& point : group.points)
      law(group.samples.empty() || point.sample < group.samples.size(), "a point of no sample");
    if (const auto gas = segment::expanded(group.points, 0.01, {}); !gas) check_error(gas.error());
  }
  return true;
}

std::vector<std::string> height_seeds() { return {"# tops\n0\n0.1\n0.25 # thick\n1e0\r\n\n2.0\t\n"}; }
std::vector<std::string> width_seeds() {
  segment::PieceRequest request;
  return {
      pipeline::widths_text(request),
      "test;percent;thick_speed_percent;region;wall_mm;thick_mm;thin_mm;continuous_mm;stable_mm\nflow;;;;0.41;;;;\n"
      "speed;150;;;;0.6;0.35;;2\nspeed;200;;;;0.6;0.3;;1.5\nextrusion;80;;;;0.5;0.3;;\n"
      "repeated;100;100;initial;;0.55;0.3;0.4;\nrepeated;100;100;central;;0.56;0.31;0.4;\nrepeated;100;100;final;;0.55;0.3;0.4;\n"};
}
std::vector<std::string> flow_seeds() {
  return {"configuration,flow_l_min,drop_pa,drop2_mbar\na,1,10,0.1\na,2,25,\na,3,45,0.44\na,4,70,\nb,1,5,\nb,2,11,\nb,3,18,\n",
          "sample;flow_l_min;drop_pa\na;1;10\na;2;25\na;3;45\nb;1;11\nb;2;24\nb;3;46\n;4;9\n",
          "velocity_m_s\tdrop_kpa\n0.1\t1\n0.2\t2.5\n0.3\t4.5\n"};
}

const Registered kHeights(
    {"table_heights", read_heights, height_seeds, "stages/heights/evaluate stages/support/text", "", {}, 512});
const Registered kWidths({"table_widths", read_widths, width_seeds, "stages/segment/pieces stages/support/text", ".csv",
                          "tables.dict", 1024});
const Registered kFlows({"table_flows", read_flows, flow_seeds, "stages/segment/permeability stages/support/text", ".csv",
                         "tables.dict", 1024});

}  // namespace
}  // namespace lamina::fuzz
