// lamina permeability: k1 and k2 of measured pressure drops, and k1 predicted from written toolpaths.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "pipeline/calibrate/drops_page.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/keys.h"
#include "pipeline/cli/other_programs.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/cli/pores.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/job_command.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/output/temporary_folder.h"
#include "pipeline/plan/plan.h"
#include "pipeline/pores/pore_analysis.h"
#include "pipeline/run/run.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// A warning about implausible properties of a fluid, one line; "" if none.
std::string odd_about(const segment::Fluid& fluid) {
  if (fluid.density_kg_m3 <= 100 || fluid.viscosity_pa_s >= 1e-4) return {};
  return fmt::format(
      "a fluid of {:.4g} Pa.s and {:.4g} kg/m3 is neither a gas nor a liquid: the density is that of water; "
      "k2 for air is {:.4g} times smaller",
      fluid.viscosity_pa_s, fluid.density_kg_m3, fluid.density_kg_m3 / 1.2);
}

CommandSpec permeability_spec() {
  CommandSpec spec;
  spec.summary =
      "Fits Darcy's k1 and Forchheimer's k2 to measured flows and pressure drops, dp / L = (mu / k1) v + (rho / k2) v^2,\n"
      "with standard errors. Predicts k1 of G-code or layer images: a window of them is divided into voxels, and the\n"
      "creeping flow through the pores is computed. Job files are planned first.";
  spec.operand = "FILE|DIR|JOB";
  spec.operand_meaning =
      "a table, a G-code file, a folder of images, or a job file with optional parts that replace its own. Table columns:\n"
      "flow_l_min or velocity_m_s, one or more drop_mbar (or _pa, _kpa, _bar, _psi), optional configuration and sample\n"
      "(without sample, each drop column is one). Folders: of lamina jet, or images (.png, .tif, .bmp, .pbm, .pgm), the lowest first";
  const std::vector<std::string_view> beads = {"deposited", "spread", "stated"};
  spec.options = {
      {"--length", "MM", "length of the medium along the flow in mm", "", "Medium"},
      {"--diameter", "MM", "diameter of a round medium in mm", "", "Medium"},
      {"--area", "MM2", "cross-section of the medium in mm2, instead of --diameter", "", "Medium"},
      {"--viscosity", "PA.S", "viscosity of the fluid in Pa s", "1.81e-05", "Fluid"},
      {"--density", "KG/M3", "density of the fluid in kg/m3", "1.204", "Fluid"},
      {"--compressible", "", "also fit as an expanding gas: (p_in^2 - p_out^2) / (2 p L)", "", "Fluid"},
      {"--outlet-pressure", "PA", "absolute pressure at the outlet in Pa", "101325", "Fluid"},
      {"--flow-pressure", "PA", "reference pressure of flow and density in Pa; default: outlet", "", "Fluid"},
      {"--convention", "NAME", "dinisio2022: reproduces Table 25 of Di Nisio (2022)", "", "Fluid", {"dinisio2022"}},
      {"--window", "X,Y,Z", "window in mm; default: the period, else 2,2 and 8 layers; images: 2,2,2", "",
       "Toolpaths and images"},
      {"--voxel", "UM", "voxel size in micrometres; default for images: their pixels", "10", "Toolpaths and images"},
      {"--memory", "SIZE", "memory limit of the flow solver: 512M, 2G", "1G", "Toolpaths and images"},
      {"--beads", "WORD", "bead model: spread, deposited (no spread along lines), stated", "spread for known printers",
       "Toolpaths", beads},
      {"--machine", "NAME|FILE", "printer of the toolpaths or job; default: named by the file", "", "Toolpaths"},
      {"--set", "KEY=VALUE", "set a job key, as in bed.dpi=600 or part.2.copies=3", "", "Job"},
      {"--inertia", "", "also compute Forchheimer's k2 along z, from six air flows", "", "Toolpaths"},
      {"--plot", "FILE", "plot of the fit, or sections of flow and pores, as .svg or .png", "", "Result"},
      {"--overwrite", "", "replace a file that lamina did not write", "", "Result"},
      {"--json", "", "print the result as one JSON object on stdout", "", "Result"}};
  const std::vector<OptionSpec> files = window_file_options(), images = stack_options();
  spec.options.insert(spec.options.end() - 2, files.begin(), files.end());
  const auto plot = std::ranges::find(spec.options, "--plot", &OptionSpec::flag);
  spec.options.insert(plot, images.begin(), images.end());
  spec.closing =
      "Rows of one column `configuration` are fitted group by group, and within it each sample by itself. Standard errors take\n"
      "all points as independent; where samples differ, the deviation between them is more meaningful. With --compressible both forms are\n"
      "reported, and air has the density that it has at p. The convention dinisio2022 is L = 25.5 mm, v = Q / 28 in\n"
      "m/s of L/min (466.67 mm2), 1.87e-5 Pa.s and 998.2 kg/m3, which is water: its k2 is 832 times that of air;\n"
      "with --compressible, an outlet at 102600 Pa.\n\n"
      "Examples:\n  lamina permeability drops.csv --length 25.4 --diameter 25.4\n"
      "  lamina permeability drops.csv --convention dinisio2022 --plot fit.svg\n"
      "  lamina permeability drops.csv --length 25.4 --diameter 25.4 --compressible --outlet-pressure 95000\n"
      "  lamina permeability part.gcode --voxel 20 --plot pores.png\n"
      "  lamina permeability job.toml --set segment.thin_mm=2\n"
      "  lamina permeability pores.toml part.stl --machine anet-a8\n"
      "  lamina permeability part.gcode --window 2,2,0.6 --solid beads.nrrd --void pores.stl --no-flow";
  return spec;
}

/// Where a gas is measured; air has its density there. errors  kUsage
Status read_pressures(const Arguments& arguments, segment::DropsSettings& settings) {
  for (const char* flag : {"--outlet-pressure", "--flow-pressure"}) {
    if (arguments.has(flag) && !settings.gas) return usage("{}: is of gases that expand; give --compressible too", flag);
  }
  if (!settings.gas) return {};
  segment::GasPressures& gas = *settings.gas;
  if (Status status = arguments.read("--outlet-pressure", {1, 1e9}, gas.outlet_pa); !status) return status;
  gas.reference_pa = gas.outlet_pa;
  if (Status status = arguments.read("--flow-pressure", {1, 1e9}, gas.reference_pa); !status) return status;
  if (!arguments.has("--density") && !arguments.has("--convention")) settings.fluid.density_kg_m3 *= gas.reference_pa / 101325;
  return {};
}

/// Medium and fluid from the options. errors  kUsage
Result<segment::DropsSettings> read_settings(const Arguments& arguments) {
  segment::DropsSettings settings;
  if (arguments.has("--compressible")) settings.gas.emplace();
  if (arguments.has("--convention")) {
    if (arguments.text("--convention") != "dinisio2022")
      return usage("--convention: unknown convention '{}'; must be dinisio2022", one_line(arguments.text("--convention")));
    settings.medium = {0.0255, 1e-3 / 60 * 28};
    settings.fluid = {1.87e-5, 998.2};
    if (settings.gas) settings.gas->outlet_pa = 102600;
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
  if (Status status = read_pressures(arguments, settings); !status) return status.error();
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
  const auto fits = segment::fit_drops(file, *settings);
  if (!fits) return fits.error();
  Json json = {{"command", "permeability"}, {"fits", Json::array()}, {"warnings", Json::array()}};
  std::string text;
  std::vector<std::string> warnings;
  for (const segment::DropsFit& fit : *fits) {
    text += as_text(fit);
    json["fits"].push_back(as_json(fit));
    warnings.insert(warnings.end(), fit.warnings.begin(), fit.warnings.end());
  }
  if (!plot.empty()) {
    if (Status status = write_plot(plot, draw(fits->front())); !status) return status;
    if (fits->size() > 1) {
      context.say(
          fmt::format("note: {} is of {}, the first of {} configurations", plot, fits->front().group.name, fits->size()));
    }
  }
  if (std::string warning = odd_about(settings->fluid); !warning.empty()) warnings.push_back(std::move(warning));
  for (const std::string& warning : warnings) {
    context.say_text(fmt::format("warning   {}\n", one_line(warning)));
    json["warnings"].push_back(warning);
  }
  return arguments.has("--json") ? context.give(json) : context.print(text);
}

constexpr std::string_view kOfTables[] = {"--length",       "--diameter",        "--area",
                                          "--viscosity",    "--density",         "--convention",
                                          "--compressible", "--outlet-pressure", "--flow-pressure"};
constexpr std::string_view kOfImages[] = {"--pixel", "--layer-um", "--threshold", "--dark"};
constexpr std::string_view kOfVoxels[] = {"--window", "--voxel", "--memory", "--solid", "--void", "--no-flow"};
constexpr std::string_view kOfToolpaths[] = {"--beads", "--machine", "--inertia", "--scan"};

/// errors  kUsage: one of the options is given
Status refuse(const Arguments& arguments, std::span<const std::string_view> flags, const char* why) {
  for (const std::string_view flag : flags)
    if (arguments.has(flag)) return usage("{} is for {}", flag, why);
  return {};
}

/// What can be reported about one file or folder. part  as predict_print() takes it
Outcome analyse_file(const Arguments& arguments, Context& context, const std::optional<Box>& part) {
  if (arguments.operands.size() != 1)
    return usage("name one file of measurements or of toolpaths, a folder of images, or a job with its parts");
  const std::string& operand = arguments.operands.front();
  std::error_code ignored;
  const std::filesystem::path path = operand;
  if (!path.has_extension() && !std::filesystem::exists(path, ignored))  // a table's name has one; its reader reports the error
    return failure(Fault::kInput, "{}: no such file or folder", one_line(operand));
  const bool images = std::filesystem::is_directory(operand, ignored), beads = !images && names_toolpaths(operand);
  Status fits = images || beads ? refuse(arguments, kOfTables, "tables of measurements, not for toolpaths or images")
                                : refuse(arguments, kOfVoxels, "toolpaths and images, not for tables of measurements");
  if (images && !fits) return failure(Fault::kInput, "{}: is a folder; {}", one_line(operand), fits.error().message);
  if (fits && !images && !arguments.has("--scan")) fits = refuse(arguments, kOfImages, "folders of images");
  if (fits && !images) fits = refuse(arguments, std::array<std::string_view, 1>{"--periodic"}, "folders of images");
  if (fits && !beads) fits = refuse(arguments, kOfToolpaths, "toolpaths");
  if (fits && !arguments.has("--scan")) fits = refuse(arguments, std::array<std::string_view, 1>{"--range"}, "--scan DIR");
  if (fits && arguments.has("--no-flow"))
    fits = refuse(arguments, std::array<std::string_view, 2>{"--inertia", "--memory"}, "the flow, which --no-flow leaves out");
  if (!fits) return fits;
  return images  ? predict_stack(arguments, context)
         : beads ? predict_print(arguments, context, part)
                 : fit_table(arguments, context);
}

// --- of a job file

/// Reports the job next to the results of its files, which have no name outside of the call.
class JobContext : public Context {
 public:
  /// made  the file or folder that the job became; shown  its name for people
  JobContext(Context& outer, std::string made, std::string shown, std::string line, Json job)
      : outer_(outer), made_(std::move(made)), shown_(std::move(shown)), line_(std::move(line)), job_(std::move(job)) {}
  void say_text(std::string_view text) override { outer_.say_text(shown(std::string(text))); }
  /// Messages name files by their paths.
  std::string shown(const std::string& text) override {
    std::string renamed = text;
    for (std::size_t at = renamed.find(made_); at != std::string::npos; at = renamed.find(made_, at + shown_.size()))
      renamed.replace(at, made_.size(), shown_);
    return renamed;
  }
  int complain(const Error& error) override { return outer_.complain(error); }
  Status print(std::string_view text) override { return outer_.print(std::exchange(line_, {}) + std::string(text)); }
  Status give(const Json& value) override {
    Json reported = value;
    reported["job"] = job_;
    return outer_.give(reported);
  }
  void progress(const ProgressEvent& event) override { outer_.progress(event); }
  const std::atomic<bool>& cancel() override { return outer_.cancel(); }

 private:
  Context& outer_;
  std::string made_, shown_, line_;
  Json job_;
};

/// The job as lamina jet and lamina extrude read it.
Result<Job> read_job_of(const Arguments& arguments) {
  Arguments of_job;
  of_job.operands.assign(arguments.operands.begin() + 1, arguments.operands.end());
  of_job.options.emplace_back("--job", arguments.operands.front());
  for (const auto& [flag, text] : arguments.options)
    if (flag == "--set" || flag == "--machine" || is_output_option(flag)) of_job.options.emplace_back(flag, text);
  Result<Job> job = read_job_options("machine.profile", of_job);
  if (!job) return job;
  job->leave_to_machine = true;
  job->quiet = true;
  job->overwrite = job->resume = job->dry_run = false;
  job->shard.reset();
  job->format = Job().format;
  return job;
}

/// The command that a saved job names in its first line; "" for others.
std::string saved_command(const std::string& path) {
  const auto text = read_file(path, {.fault = Fault::kUsage, .missing = "no such job file", .max_bytes = kMaxTomlBytes});
  return text ? std::string(command_in(std::string_view(*text).substr(0, text->find('\n')))) : "";
}

/// errors  kUsage: no such machine, or nothing names it
Result<Product> product_of(const std::string& path, const Job& job, bool by_option) {
  if (!job.machine.profile.empty()) {
    const Result<bool> moves = names_extruder(job.machine.profile);
    if (!moves)
      return failure(moves.error().fault, "{}: {}", by_option ? "--machine" : one_line(path) + ": machine.profile",
                     moves.error().message);
    return *moves ? Product::kMoves : Product::kImages;
  }
  if (const std::string command = saved_command(path); command == "extrude" || command == "jet")
    return command == "jet" ? Product::kImages : Product::kMoves;
  const auto names = [&](std::initializer_list<std::string_view> sections) {
    return std::ranges::any_of(job.named, [&](std::string_view key) {
      return std::ranges::any_of(sections, [&](std::string_view section) { return key.starts_with(section); });
    });
  };
  const bool moves = names({"extrude."}), images = names({"bed.dpi", "dose.", "image.format", "image.mirror"});
  if (images != moves) return images ? Product::kImages : Product::kMoves;
  return usage(
      "{}: names no machine, and may be of filament or of powder; add --machine, as in --machine anet-a8 or --machine nuferbj",
      one_line(path));
}

/// The box of the first part in machine coordinates, of a job that has others too.
std::optional<Box> first_part(const Summary& summary, const std::array<double, 2>& corner_mm) {
  const bool alone = summary.parts.size() == 1 && summary.parts.front().copies == 1;
  if (alone || summary.parts.empty() || summary.parts.front().bounds.empty()) return std::nullopt;
  Box box = summary.parts.front().bounds;
  const auto x = static_cast<Nm>(std::llround(corner_mm[0] * 1e6)), y = static_cast<Nm>(std::llround(corner_mm[1] * 1e6));
  box.lo.x += x, box.hi.x += x, box.lo.y += y, box.hi.y += y;
  return box;
}

/// The arguments of a call on the files.
Arguments arguments_on(const std::string& files, const Job& job, Product product, const Arguments& arguments) {
  Arguments inner = arguments;
  inner.operands = {files};
  std::erase_if(inner.options, [](const auto& option) { return option.first == "--set" || option.first == "--machine"; });
  // Toolpaths name no printer that a file describes.
  if (product == Product::kMoves && !job.machine.profile.empty() && arguments.text("--beads") != "stated")
    inner.options.emplace_back("--machine", job.machine.profile);
  return inner;
}

/// Plans the job of the first operand as lamina extrude or lamina jet does, with parts of the other operands in place of its
/// own, --set and --machine, and predicts what was written: G-code or bitmaps in a temporary folder, in the place of the job.
/// The machine decides which of the two; a job without one its first line as lamina saves it, or keys that one of the two
/// reads alone.
/// errors  those of reading, checking and running a job, and of analyse_file, with the job's name; kUsage: it is unknown which
/// of
///         the two, toolpaths of another format than G-code
Outcome predict_job(const Arguments& arguments, Context& context) {
  const std::string& path = arguments.operands.front();
  Result<Job> job = read_job_of(arguments);
  if (!job) return job.error();
  const Result<Product> product = product_of(path, *job, arguments.has("--machine"));
  if (!product) return product.error();
  const bool moves = *product == Product::kMoves;
  if (moves && job->segment.all.on && job->fill.all.pattern == infill::Pattern::kNone)
    job->fill.all.pattern = infill::Pattern::kRaster;
  const TemporaryFolder folder("permeability");
  if (const Status status = folder.status(); !status) return status;
  job->output = folder.file(moves ? "part.gcode" : "job");
  if (Status status = check_job(*job); !status) return status;
  Result<Resolved> resolved = resolve(*job, *product);
  if (!resolved) return resolved.error();
  std::array<double, 2> corner_mm{};
  if (resolved->extruder) {
    const Extruder& machine = resolved->extruder->machine;
    if (machine.format != "gcode")
      return usage("{}: {} writes {}, and beads are read from G-code; add another --machine", one_line(path), machine.name,
                   machine.format);
    corner_mm = machine.bed.corner_mm;
  }
  keep_on_signals();
  const auto summary = run(
      std::move(*resolved), [](const ProgressEvent&) {}, context.cancel());
  if (!summary) {
    if (summary.error().fault == Fault::kInterrupted) return failure(Fault::kInterrupted, "interrupted; nothing was written");
    return summary.error();
  }
  for (const Warning& warning : summary->warnings) context.say_text(fmt::format("warning   {}\n", one_line(warning.text)));
  Json parts = Json::array();
  for (const PartSummary& part : summary->parts) parts.push_back(part.path);
  const std::string machine = summary->machine.empty() ? "" : ", " + one_line(summary->machine);
  JobContext reported(context, job->output, one_line(path),
                      fmt::format("job       {}: planned as lamina {} does, {} layers {}{}\n", one_line(path),
                                  command_name(*product), summary->layers_planned, summary->layer_text, machine),
                      {{"path", path},
                       {"command", command_name(*product)},
                       {"machine", summary->machine},
                       {"layers", summary->layers_planned},
                       {"parts", parts},
                       {"warnings", warnings_json(summary->warnings)}});
  Outcome outcome = analyse_file(arguments_on(job->output, *job, *product, arguments), reported,
                                 moves ? first_part(*summary, corner_mm) : std::nullopt);
  if (outcome.error) outcome.error->message = reported.shown(outcome.error->message);
  return outcome;
}

Outcome run_permeability(const Arguments& arguments, Context& context) {
  if (!arguments.operands.empty() && lower_case(arguments.operands.front()).ends_with(".toml"))
    return predict_job(arguments, context);
  if (const Status fits = refuse(arguments, std::array<std::string_view, 1>{"--set"}, "job files, as in job.toml"); !fits)
    return fits;
  return analyse_file(arguments, context, std::nullopt);
}

}  // namespace

const Command permeability_command = {"permeability", "fit measured pressure drops; predict permeability from G-code or images",
                                      permeability_spec, run_permeability};

}  // namespace lamina::pipeline
