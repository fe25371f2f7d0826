// lamina permeability: k1 and k2 of measured pressure drops.
#include <fmt/format.h>

#include <numbers>

#include "pipeline/cli/command.h"
#include "pipeline/cli/plot_file.h"
#include "stages/data/text/json.h"
#include "stages/data/text/readable.h"
#include "stages/segment/flows.h"

namespace lamina::pipeline {
namespace {

struct Settings {
  segment::Medium medium;
  segment::Fluid fluid;
};

CommandSpec permeability_spec() {
  CommandSpec spec;
  spec.summary =
      "Fits dp / L = (mu / k1) v + (rho / k2) v^2 to measured flows and pressure drops: Darcy's k1, Forchheimer's k2,\n"
      "their standard errors and the quality of the fit.";
  spec.operand = "FILE";
  spec.operand_meaning =
      "a table with a header: flow_l_min (or velocity_m_s) and drop_mbar (or _pa, _kpa, _bar, _psi), any number of drop columns";
  spec.options = {
      {"--length", "MM", "of the medium along the flow", "", "Medium"},
      {"--diameter", "MM", "of a round medium", "", "Medium"},
      {"--area", "MM2", "cross-section, in place of a diameter", "", "Medium"},
      {"--viscosity", "PA.S", "of the fluid", "1.81e-05", "Fluid"},
      {"--density", "KG/M3", "of the fluid", "1.204", "Fluid"},
      {"--convention", "NAME", "dinisio2022: what reproduces Table 25 of that document", "", "Fluid", {"dinisio2022"}},
      {"--plot", "FILE", "draw points and parabola, as .svg or .png", "", "Result"},
      {"--overwrite", "", "replace a file that lamina did not write", "", "Result"},
      {"--json", "", "print the result as one JSON object on stdout", "", "Result"}};
  spec.closing =
      "Rows of one column `configuration` are fitted group by group. The convention dinisio2022 is L = 25.5 mm, v = Q / 28 in\n"
      "m/s of L/min (466.67 mm2), 1.87e-5 Pa.s and 998.2 kg/m3, which is water: its k2 is 832 times that of air.\n\n"
      "Examples:\n  lamina permeability drops.csv --length 25.4 --diameter 25.4\n"
      "  lamina permeability drops.csv --convention dinisio2022 --plot fit.svg";
  return spec;
}

/// Medium and fluid from the options. errors  kUsage
Result<Settings> read_settings(const Arguments& arguments) {
  const auto usage = [](const std::string& what) { return Error{Fault::kUsage, what}; };
  Settings settings;
  if (arguments.has("--convention")) {
    if (arguments.text("--convention") != "dinisio2022") {
      return usage(fmt::format("--convention: '{}' is none of dinisio2022", one_line(arguments.text("--convention"))));
    }
    settings = {{0.0255, 1e-3 / 60 * 28}, {1.87e-5, 998.2}};
  }
  const auto number = [&](const char* flag, double unit, double& target) {
    double value = 0;
    const Status status = arguments.read(flag, {1e-12, 1e9}, value);
    if (value > 0) target = value * unit;
    return status;
  };
  if (arguments.has("--area") && arguments.has("--diameter"))
    return usage("--area and --diameter exclude each other; give one");
  double diameter = 0;
  for (const Status& status :
       {number("--length", 1e-3, settings.medium.length_m), number("--area", 1e-6, settings.medium.area_m2),
        number("--diameter", 1e-3, diameter), number("--viscosity", 1, settings.fluid.viscosity_pa_s),
        number("--density", 1, settings.fluid.density_kg_m3)}) {
    if (!status) return status.error();
  }
  if (diameter > 0) settings.medium.area_m2 = std::numbers::pi / 4 * diameter * diameter;
  if (!(settings.medium.length_m > 0)) return usage("--length is missing; give the medium's length along the flow in mm");
  if (!(settings.medium.area_m2 > 0)) return usage("--diameter or --area is missing; give the medium's cross-section");
  return settings;
}

Outcome run_permeability(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 1) return Error{Fault::kUsage, "name one file of measurements"};
  const std::string &file = arguments.operands.front(), plot = arguments.text("--plot");
  if (Status status = check_plot_name(plot); !status) return status;
  const auto settings = read_settings(arguments);
  if (!settings) return settings.error();
  const auto groups = segment::read_flows(file, settings->medium);
  if (!groups) return groups.error();
  Json json = {{"command", "permeability"}, {"fits", Json::array()}, {"warnings", Json::array()}};
  std::string text;
  for (const segment::FlowGroup& group : *groups) {
    const auto fit = segment::fit_permeability(group.points, settings->fluid);
    if (!fit)
      return Error{fit.error().fault,
                   fmt::format("{}: {}{}", file, group.name.empty() ? "" : group.name + ": ", fit.error().message)};
    const double k1 = fit->k1_m2 / segment::kDarcy, k1_error = fit->k1_error_m2 / segment::kDarcy;
    text += fmt::format(
        "{}k1   {:.2f} +- {:.2f} D ({:.4e} m2)\nk2   {:.4g} +- {:.2g} m\nfit  R2 {:.6f}, {} points, scatter {:.4g} Pa/m\n",
        group.name.empty() ? "" : group.name + "\n", k1, k1_error, fit->k1_m2, fit->k2_m, fit->k2_error_m, fit->r_squared,
        group.points.size(), fit->scatter_pa_m);
    json["fits"].push_back({{"configuration", group.name},
                            {"points", group.points.size()},
                            {"k1_darcy", k1},
                            {"k1_error_darcy", k1_error},
                            {"k1_m2", fit->k1_m2},
                            {"k2_m", fit->k2_m},
                            {"k2_error_m", fit->k2_error_m},
                            {"r_squared", fit->r_squared},
                            {"scatter_pa_m", fit->scatter_pa_m}});
    if (plot.empty() || &group != &groups->front()) continue;
    if (Status status = write_plot(plot, draw_fit(group, *fit)); !status) return status;
  }
  if (!plot.empty() && groups->size() > 1) {
    context.say(fmt::format("note: {} is of {}, the first of {} configurations", plot, groups->front().name, groups->size()));
  }
  if (const std::string warning = segment::odd_about(settings->fluid); !warning.empty()) {
    context.say_text(fmt::format("warning   {}\n", warning));
    json["warnings"].push_back(warning);
  }
  return arguments.has("--json") ? context.give(json) : context.print(text);
}

}  // namespace

const Command permeability_command = {"permeability", "Darcy's and Forchheimer's coefficients from flows and pressure drops",
                                      permeability_spec, run_permeability};

}  // namespace lamina::pipeline
