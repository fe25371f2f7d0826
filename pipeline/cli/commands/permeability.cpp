// lamina permeability: k1 and k2 of measured pressure drops.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>
#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/text/json.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/names.h"
#include "pipeline/text/number_text.h"
#include "pipeline/text/table.h"
#include "stages/segment/permeability.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

struct Unit {
  std::string_view ending;
  double si;
};
// Longer endings first: "_mbar" also ends in "bar".
constexpr Unit kFlows[] = {{"_l_min", 1e-3 / 60}, {"_ml_min", 1e-6 / 60}, {"_l_h", 1e-3 / 3600},
                           {"_m3_h", 1.0 / 3600}, {"_m3_s", 1},           {"_l_s", 1e-3}};
constexpr Unit kVelocities[] = {{"_mm_s", 1e-3}, {"_cm_s", 1e-2}, {"_m_s", 1}};
constexpr Unit kDrops[] = {{"_mbar", 100}, {"_kpa", 1000}, {"_hpa", 100}, {"_pa", 1}, {"_bar", 1e5}, {"_psi", 6894.757293}};

template <std::size_t N>
double unit_of(std::string name, const Unit (&units)[N]) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const Unit& unit : units) {
    if (name.ends_with(unit.ending)) return unit.si;
  }
  return 0;
}

struct Settings {
  double length_m = 0, area_m2 = 0;
  segment::Fluid fluid;
  bool document = false;
};

struct Group {
  std::string name;
  std::vector<segment::FlowPoint> points;
};

/// A table with a header: one column of flows or velocities, one or more of pressure drops; units by their endings.
Result<std::vector<Group>> read_points(const std::string& path, const Settings& settings) {
  const auto wrong = [&](std::size_t line, const std::string& what) {
    return Error{Fault::kInput, line == 0 ? fmt::format("{}: {}", path, what) : fmt::format("{}:{}: {}", path, line, what)};
  };
  std::ifstream file(path);
  if (!file) return wrong(0, "no such file, or it cannot be read");
  std::vector<std::string> names;
  std::vector<double> drop_units;
  std::size_t flow_column = SIZE_MAX, group_column = SIZE_MAX;
  double flow_unit = 0;
  bool velocity = false;
  char separator = ',';
  std::vector<Group> groups;
  std::size_t number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    if (line.empty() || line[0] == '#' || line == "\r") continue;
    if (names.empty()) {
      separator = separator_of(line);
      names = cells_of(line, separator);
      drop_units.assign(names.size(), 0);
      bool drops = false;
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (names[i] == "configuration") group_column = i;
        if (const double unit = unit_of(names[i], kDrops); unit > 0) {
          drop_units[i] = unit;
          drops = true;
        } else if (const double flow = unit_of(names[i], kFlows); flow > 0 && flow_column == SIZE_MAX) {
          flow_column = i;
          flow_unit = flow;
        } else if (const double speed = unit_of(names[i], kVelocities); speed > 0 && flow_column == SIZE_MAX) {
          flow_column = i;
          flow_unit = speed;
          velocity = true;
        }
      }
      if (flow_column == SIZE_MAX)
        return wrong(number, "no column of flows (flow_l_min, flow_ml_min, flow_m3_s) or velocities (velocity_m_s)");
      if (!drops) return wrong(number, "no column of pressure drops (drop_pa, drop_kpa, drop_mbar, drop_bar, drop_psi)");
      continue;
    }
    const auto cells = cells_of(line, separator);
    if (cells.size() != names.size())
      return wrong(number, fmt::format("{} columns where the header has {}", cells.size(), names.size()));
    double flow = 0;
    if (const auto what = read_number(cells[flow_column], 0, 1e12, "", flow); !what.empty())
      return wrong(number, fmt::format("{}: {}", names[flow_column], what));
    const double v = flow * flow_unit / (velocity ? 1 : settings.area_m2);
    const std::string name = group_column == SIZE_MAX ? std::string() : cells[group_column];
    auto group = std::ranges::find(groups, name, &Group::name);
    if (group == groups.end()) group = groups.insert(groups.end(), {name, {}});
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (drop_units[i] == 0 || cells[i].empty()) continue;
      double drop = 0;
      if (const auto what = read_number(cells[i], -1e12, 1e12, "", drop); !what.empty())
        return wrong(number, fmt::format("{}: {}", names[i], what));
      group->points.push_back({v, drop * drop_units[i] / settings.length_m});
    }
  }
  if (groups.empty()) return wrong(0, "holds no measurements; the first line names the columns, the others hold numbers");
  return groups;
}

/// Points and parabola as SVG.
std::string plot_of(const Group& group, const segment::Permeability& fit) {
  double most_v = 0, most_y = 0;
  for (const auto& p : group.points) {
    most_v = std::max(most_v, p.velocity_m_s);
    most_y = std::max(most_y, p.gradient_pa_m);
  }
  const auto x = [&](double v) { return 60 + 520 * v / most_v; };
  const auto y = [&](double g) { return 360 - 320 * g / most_y; };
  std::string svg =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"620\" height=\"420\" font-family=\"sans-serif\" font-size=\"12\">\n<!-- drawn by lamina -->\n"
      "<rect width=\"620\" height=\"420\" fill=\"white\"/>\n<path d=\"M60 30V360H590\" fill=\"none\" stroke=\"black\"/>\n";
  svg += fmt::format(
      "<text x=\"300\" y=\"400\">velocity, 0 to {:.4g} m/s</text>\n<text x=\"10\" y=\"20\">pressure drop / length, 0 to {:.4g} Pa/m; "
      "k1 {:.2f} D, k2 {:.4g} m, R2 {:.5f} {}</text>\n",
      most_v, most_y, fit.k1_m2 / segment::kDarcy, fit.k2_m, fit.r_squared,
      group.name.find_first_of("<>&") == std::string::npos ? group.name : "");
  std::string curve;
  for (int i = 0; i <= 100; ++i) {
    const double v = most_v * i / 100;
    curve += fmt::format("{}{:.2f} {:.2f}", i == 0 ? "M" : "L", x(v), y(fit.linear * v + fit.quadratic * v * v));
  }
  svg += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"#c33\"/>\n", curve);
  for (const auto& p : group.points)
    svg += fmt::format("<circle cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"2.5\" fill=\"#26c\" fill-opacity=\"0.5\"/>\n",
                       x(p.velocity_m_s), y(p.gradient_pa_m));
  return svg + "</svg>\n";
}

CommandSpec permeability_spec() {
  CommandSpec spec;
  spec.summary =
      "Fits dp / L = (mu / k1) v + (rho / k2) v^2 to measured flows and pressure drops: Darcy's k1, Forchheimer's k2,\n"
      "their standard errors and the quality of the fit.";
  spec.operand = "FILE";
  spec.operand_meaning =
      "a table with a header: flow_l_min (or velocity_m_s) and drop_mbar (or _pa, _kpa, _bar, _psi), any number of drop columns";
  spec.options = {{"--length", "MM", "of the medium along the flow", "", "Medium"},
                  {"--diameter", "MM", "of a round medium", "", "Medium"},
                  {"--area", "MM2", "cross-section, in place of a diameter", "", "Medium"},
                  {"--viscosity", "PA.S", "of the fluid", "1.81e-05", "Fluid"},
                  {"--density", "KG/M3", "of the fluid", "1.204", "Fluid"},
                  {"--convention", "NAME", "dinisio2022: what reproduces Table 25 of that document", "", "Fluid"},
                  {"--plot", "FILE", "draw points and parabola as SVG", "", "Result"},
                  {"--overwrite", "", "replace a file that lamina did not write", "", "Result"},
                  {"--json", "", "print the result as one JSON object on stdout", "", "Result"}};
  spec.closing =
      "Rows of one column `configuration` are fitted group by group. The convention dinisio2022 is L = 25.5 mm, v = Q / 28 in\n"
      "m/s of L/min (466.67 mm2), 1.87e-5 Pa.s and 998.2 kg/m3, which is water: its k2 is 832 times that of air.\n\n"
      "Examples:\n  lamina permeability drops.csv --length 25.4 --diameter 25.4\n"
      "  lamina permeability table_18.tsv --convention dinisio2022 --plot fit.svg";
  return spec;
}

Outcome run_permeability(const Arguments& arguments, Context& context) {
  const auto usage = [](const std::string& what) { return Error{Fault::kUsage, what}; };
  if (arguments.operands.size() != 1) return usage("name one file of measurements");
  Settings settings;
  if (arguments.has("--convention")) {
    if (arguments.text("--convention") != "dinisio2022") {
      return usage(fmt::format("--convention: '{}' is none of dinisio2022", one_line(arguments.text("--convention"))));
    }
    settings = {0.0255, 1e-3 / 60 * 28, {1.87e-5, 998.2}, true};
  }
  double value = 0;
  const auto number = [&](const char* flag, double unit, double& target) {
    if (!arguments.has(flag)) return std::string();
    const std::string wrong = read_number(arguments.text(flag), 1e-12, 1e9, "", value);
    if (wrong.empty()) target = value * unit;
    return wrong.empty() ? wrong : fmt::format("{}: {}", flag, wrong);
  };
  double diameter = 0;
  for (const std::string& wrong :
       {number("--length", 1e-3, settings.length_m), number("--area", 1e-6, settings.area_m2),
        number("--diameter", 1e-3, diameter), number("--viscosity", 1, settings.fluid.viscosity_pa_s),
        number("--density", 1, settings.fluid.density_kg_m3)}) {
    if (!wrong.empty()) return usage(wrong);
  }
  if (diameter > 0) settings.area_m2 = std::numbers::pi / 4 * diameter * diameter;
  if (!(settings.length_m > 0)) return usage("--length is missing; give the medium's length along the flow in mm");
  if (!(settings.area_m2 > 0)) return usage("--diameter or --area is missing; give the medium's cross-section");
  const auto groups = read_points(arguments.operands.front(), settings);
  if (!groups) return groups.error();
  const std::string warning =
      settings.fluid.density_kg_m3 > 100 && settings.fluid.viscosity_pa_s < 1e-4
          ? fmt::format(
                "a fluid of {:.4g} Pa.s and {:.4g} kg/m3 is neither a gas nor a liquid: the density is that of water; "
                "k2 for air is {:.4g} times smaller",
                settings.fluid.viscosity_pa_s, settings.fluid.density_kg_m3, settings.fluid.density_kg_m3 / 1.2)
          : std::string();
  std::string json, text;
  for (const Group& group : *groups) {
    const auto fit = segment::fit_permeability(group.points, settings.fluid);
    if (!fit)
      return Error{fit.error().fault, fmt::format("{}: {}{}", arguments.operands.front(),
                                                  group.name.empty() ? "" : group.name + ": ", fit.error().message)};
    const double k1 = fit->k1_m2 / segment::kDarcy, k1_error = fit->k1_error_m2 / segment::kDarcy;
    text += fmt::format(
        "{}k1   {:.2f} +- {:.2f} D ({:.4e} m2)\nk2   {:.4g} +- {:.2g} m\nfit  R2 {:.6f}, {} points, scatter {:.4g} Pa/m\n",
        group.name.empty() ? "" : group.name + "\n", k1, k1_error, fit->k1_m2, fit->k2_m, fit->k2_error_m, fit->r_squared,
        group.points.size(), fit->scatter_pa_m);
    json += fmt::format(
        "{}{{\"configuration\":{},\"points\":{},\"k1_darcy\":{},\"k1_error_darcy\":{},\"k1_m2\":{},\"k2_m\":{},\"k2_error_m\":{},"
        "\"r_squared\":{},\"scatter_pa_m\":{}}}",
        json.empty() ? "" : ",", json_string(group.name), group.points.size(), k1, k1_error, fit->k1_m2, fit->k2_m,
        fit->k2_error_m, fit->r_squared, fit->scatter_pa_m);
    if (arguments.has("--plot") && &group == &groups->front()) {
      if (Status status = write::write_file(arguments.text("--plot"), plot_of(group, *fit)); !status) return status.error();
    }
  }
  if (!warning.empty()) context.say_text(fmt::format("warning   {}\n", warning));
  if (!arguments.has("--json")) return context.print(text);
  return context.give(Json::parse(fmt::format("{{\"command\":\"permeability\",\"fits\":[{}],\"warnings\":[{}]}}\n", json,
                                              warning.empty() ? "" : json_string(warning))));
}

}  // namespace

const Command permeability_command = {"permeability", "Darcy's and Forchheimer's coefficients from flows and pressure drops",
                                      permeability_spec, run_permeability};

}  // namespace lamina::pipeline
