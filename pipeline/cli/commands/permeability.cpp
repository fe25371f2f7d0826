// lamina permeability: k1 and k2 of measured pressure drops, and k1 predicted from written toolpaths.
#include <fmt/format.h>

#include <filesystem>
#include <numbers>

#include "pipeline/calibrate/bead_voxels.h"
#include "pipeline/calibrate/pore_page.h"
#include "pipeline/calibrate/predict_flow.h"
#include "pipeline/calibrate/window_choice.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/plot_file.h"
#include "pipeline/cli/pore_stack.h"
#include "pipeline/cli/window_files.h"
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
      "their standard errors and the quality of the fit. Of G-code, predicts Darcy's k1: cuts what repeats of the beads, or a\n"
      "window, into voxels and computes how a fluid creeps through their pores. The same of layer images: a window of what\n"
      "lamina jet wrote, or of a tomography.";
  spec.operand = "FILE|DIR";
  spec.operand_meaning =
      "a table with a header: flow_l_min (or velocity_m_s) and drop_mbar (or _pa, _kpa, _bar, _psi), any number of drop columns;\n"
      "or toolpaths, as in part.gcode; or a folder: of lamina jet, or of numbered images .png, .tif or .pbm, the lowest first";
  spec.options = {
      {"--length", "MM", "of the medium along the flow", "", "Medium"},
      {"--diameter", "MM", "of a round medium", "", "Medium"},
      {"--area", "MM2", "cross-section, in place of a diameter", "", "Medium"},
      {"--viscosity", "PA.S", "of the fluid", "1.81e-05", "Fluid"},
      {"--density", "KG/M3", "of the fluid", "1.204", "Fluid"},
      {"--convention", "NAME", "dinisio2022: what reproduces Table 25 of that document", "", "Fluid", {"dinisio2022"}},
      {"--window", "X,Y,Z", "mm of a print to look at; default: what repeats, else 2,2 and eight layers; of images: 2,2,2", "",
       "Toolpaths and images"},
      {"--voxel", "UM", "edge of a voxel, micrometres; of images: their pixels", "10", "Toolpaths and images"},
      {"--memory", "SIZE", "that the flow may take, as in 2G", "1G", "Toolpaths and images"},
      {"--plot", "FILE", "draw points and parabola, as .svg or .png", "", "Result"},
      {"--overwrite", "", "replace a file that lamina did not write", "", "Result"},
      {"--json", "", "print the result as one JSON object on stdout", "", "Result"}};
  const std::vector<OptionSpec> files = window_file_options(), images = stack_options();
  spec.options.insert(spec.options.end() - 2, files.begin(), files.end());
  const auto plot = std::ranges::find(spec.options, "--plot", &OptionSpec::flag);
  spec.options.insert(plot, images.begin(), images.end());
  spec.closing =
      "Rows of one column `configuration` are fitted group by group. The convention dinisio2022 is L = 25.5 mm, v = Q / 28 in\n"
      "m/s of L/min (466.67 mm2), 1.87e-5 Pa.s and 998.2 kg/m3, which is water: its k2 is 832 times that of air.\n\n"
      "Examples:\n  lamina permeability drops.csv --length 25.4 --diameter 25.4\n"
      "  lamina permeability drops.csv --convention dinisio2022 --plot fit.svg\n"
      "  lamina permeability part.gcode --voxel 15\n"
      "  lamina permeability part.gcode --window 2,2,0.6 --solid beads.nrrd --void pores.stl --no-flow";
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

Outcome fit_table(const Arguments& arguments, Context& context) {
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

Outcome predict(const Arguments& arguments, Context& context) {
  if (Status status = check_window_files(arguments); !status) return status;
  FlowRequest request;
  if (Status status = arguments.read("--memory", read_bytes, request.memory_bytes); !status) return status.error();
  const Result<read::GcodeFile> file = read::GcodeFile::open(arguments.operands.front());
  if (!file) return file.error();
  const Result<Pile> pile = pile_of(*file);
  if (!pile) return pile.error();
  if (pile->layers.empty())
    return Error{Fault::kInput, arguments.operands.front() + ": no layer lies above z = 0; heights count from the bed"};
  if (arguments.has("--scan")) return compare_scan(arguments, context, *file, *pile);
  const Result<WindowWish> wish = read_window_wish(arguments, 10);
  if (!wish) return wish.error();
  const Result<WindowChoice> choice = choose_window(*file, *pile, *wish);
  if (!choice) return choice.error();
  const Result<VoxelStack> fine = bead_voxels(*file, *pile, choice->window);
  if (!fine) return fine.error();
  const Result<VoxelStack> coarse = bead_voxels(*file, *pile, with_half_as_many_voxels(choice->window));
  if (!coarse) return coarse.error();
  const auto files = write_window_files(arguments, *fine);
  if (!files) return files.error();
  const std::atomic<bool>& cancel = context.cancel();
  const Result<PoreReport> report =
      arguments.has("--no-flow") ? pores_alone(*fine) : look_at_pores(*fine, *coarse, request, [&](double) { return !cancel; });
  if (!report) return Error{report.error().fault, fmt::format("{}: {}", arguments.operands.front(), report.error().message)};
  if (pile->skipped > 0) {
    context.say(
        fmt::format("note: {} layers that do not lie above those before are left out, as of parts printed one after the other",
                    pile->skipped));
  }
  for (const std::optional<Darcy>& darcy : report->flow) {
    if (darcy && !darcy->resolved) context.say("note: voxels are too coarse for the pores; take a smaller --voxel");
    if (darcy && darcy->residual > 1e-2) context.say("note: the flow was not solved to its end; take a smaller --window");
  }
  if (!file->tells_widths()) context.say("note: the file tells no widths; they are those of what it feeds");
  if (!arguments.has("--json")) return context.print(as_text(*choice, *report) + as_text(*files));
  Json json = as_json(*choice, *report);
  if (!files->empty()) json["files"] = as_json(*files);
  return context.give(json);
}

bool is_gcode(const std::string& path) {
  for (const char* ending : {".gcode", ".GCODE", ".gco", ".g", ".nc"})
    if (path.ends_with(ending)) return true;
  return false;
}

constexpr std::string_view kOfTables[] = {"--length",  "--diameter",   "--area", "--viscosity",
                                          "--density", "--convention", "--plot"};
constexpr std::string_view kOfImages[] = {"--pixel", "--layer-um", "--threshold", "--dark"};
constexpr std::string_view kOfVoxels[] = {"--window", "--voxel", "--memory", "--solid", "--void", "--no-flow"};

/// errors  kUsage: one of the options is given
Status refuse(const Arguments& arguments, std::span<const std::string_view> flags, const char* why) {
  for (const std::string_view flag : flags)
    if (arguments.has(flag)) return Error{Fault::kUsage, fmt::format("{} is for {}", flag, why)};
  return {};
}

Outcome run_permeability(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 1)
    return Error{Fault::kUsage, "name one file of measurements or of toolpaths, or a folder of images"};
  const std::string& operand = arguments.operands.front();
  std::error_code ignored;
  const bool images = std::filesystem::is_directory(operand, ignored), beads = !images && is_gcode(operand);
  Status fits = images || beads ? refuse(arguments, kOfTables, "tables of measurements, not for toolpaths or images")
                                : refuse(arguments, kOfVoxels, "toolpaths and images, not for tables of measurements");
  if (images && !fits) return Error{Fault::kInput, fmt::format("{}: is a folder; {}", one_line(operand), fits.error().message)};
  if (fits && !images && !arguments.has("--scan")) fits = refuse(arguments, kOfImages, "folders of images");
  if (fits && !images) fits = refuse(arguments, std::array<std::string_view, 1>{"--periodic"}, "folders of images");
  if (fits && !beads) fits = refuse(arguments, std::array<std::string_view, 1>{"--scan"}, "toolpaths");
  if (fits && !arguments.has("--scan")) fits = refuse(arguments, std::array<std::string_view, 1>{"--range"}, "--scan DIR");
  if (!fits) return fits;
  return images ? predict_stack(arguments, context) : beads ? predict(arguments, context) : fit_table(arguments, context);
}

}  // namespace

const Command permeability_command = {"permeability",
                                      "Darcy's and Forchheimer's coefficients, of measured drops or predicted from toolpaths",
                                      permeability_spec, run_permeability};

}  // namespace lamina::pipeline
