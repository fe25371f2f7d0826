// lamina calibrate: test pieces for a printer, and the profile that follows from what was measured on them.
#include <fmt/format.h>

#include "pipeline/calibrate/calibrate.h"
#include "pipeline/calibrate/chart_job.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/other_programs.h"
#include "pipeline/job/errors.h"
#include "pipeline/machine/profiles.h"
#include "stages/calibration/chart/layout.h"
#include "stages/formats/chart/chart.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

// --- powder printers

Outcome write_chart(const ChartRequest& request, const Arguments& arguments, Context& context) {
  const std::atomic<bool>& cancel = context.cancel();
  keep_on_signals();
  const auto summary = write_chart_job(request, cancel);
  if (!summary) return summary.error();
  const std::string what = request.drops > 0 ? "drops" : "chart", directory = one_line(request.directory);
  if (!arguments.has("--quiet")) {
    context.say_text(
        fmt::format("{:9} {} in {} layer{}\n", what, directory, summary->layers_total, summary->layers_total == 1 ? "" : "s"));
    context.say_text(text_of(summary->results));
    context.say_text(
        request.drops > 0
            ? fmt::format("next      print {}/print onto what you weigh, then --drops {} --weighed-mg MG -o my.toml\n",
                          directory, request.drops)
            : fmt::format("next      print {}/print, photograph it from above, then --chart {} --scan PHOTO -o my.toml\n",
                          directory, directory));
  }
  if (!arguments.has("--json")) return {};
  return context.give(
      {{"command", "calibrate"}, {"directory", request.directory}, {what, summary->output}, {"layers", summary->layers_total}});
}

/// The drop volume from what was weighed.
Outcome weigh(const ChartRequest& request, double mass_mg, const Arguments& arguments, Context& context) {
  double density = 1;
  if (Status status = arguments.read("--density", {0.1, 20, " g/ml"}, density); !status) return status;
  auto machine = find_machine(request.machine);
  if (!machine) return machine.error();
  const double before = machine->head.drop_pl;
  machine->head.drop_pl = calibration::drop_pl_of(mass_mg, density, static_cast<double>(request.drops));
  const auto profile = measured_profile(*machine);
  if (!profile)
    return at_option("--weighed-mg",
                     fmt::format("{} of {} drops: {}", arguments.text("--weighed-mg"), request.drops, profile.error().message));
  if (Status status = write_file(request.directory, *profile); !status) return status;
  if (!arguments.has("--quiet"))
    context.say_text(fmt::format("drop      {:.4g} pl, was {:.4g}\nprofile   {}\n", machine->head.drop_pl, before,
                                 one_line(request.directory)));
  if (!arguments.has("--json")) return {};
  return context.give({{"command", "calibrate"}, {"profile", request.directory}, {"drop_pl", machine->head.drop_pl}});
}

/// The profile from a photograph of a chart.
Outcome scan(const ChartRequest& request, const Arguments& arguments, Context& context) {
  auto machine = find_machine(request.machine);
  if (!machine) return machine.error();
  const std::string chart =
      is_file(arguments.text("--chart")) ? arguments.text("--chart") : arguments.text("--chart") + "/chart.json";
  const auto text = read_file(chart, {.fault = Fault::kInput, .missing = "no such chart; lamina calibrate -o DIR writes one"});
  const auto deposited = text ? read_chart(*text, chart) : text.error();
  if (!deposited) return deposited.error();
  if (deposited->machine != machine->name)
    return at_option("--chart", fmt::format("{} is of {}, not of {}", chart, one_line(deposited->machine), machine->name));
  const auto detected = scanned(
      "chart", {{"photo", arguments.text("--scan")}, {"chart", parse_json(*text)}, {"picture", arguments.has("--overlay")}},
      arguments.text("--overlay"));
  if (!detected) return detected.error();
  const auto lines = take_over(*detected, *deposited, *machine);
  if (!lines) return lines.error();
  const auto profile = measured_profile(*machine);
  if (!profile) return profile.error();
  if (Status status = write_file(request.directory, *profile); !status) return status;
  if (!arguments.has("--quiet")) {
    for (const std::string& line : *lines) context.say(line);
    context.say("profile   " + request.directory);
  }
  if (!arguments.has("--json")) return {};
  return context.give({{"command", "calibrate"}, {"profile", request.directory}, {"reading", parse_json(*detected)}});
}

/// Options of powder printers alone.
std::vector<OptionSpec> powder_calibration_options() {
  return {{"--drops", "N", "write a job of N drops, to be weighed", "", "Powder printers"},
          {"--weighed-mg", "MG", "mass of the --drops in mg, for the drop volume of the profile", "", "Powder printers"},
          {"--density", "G/ML", "density of the binder in g/ml", "1", "Powder printers"},
          {"--scan", "PHOTO", "photograph of the printed chart, to compute the profile", "", "Powder printers"},
          {"--chart", "DIR|FILE", "chart written by an earlier call", "", "Powder printers"},
          {"--overlay", "PNG", "image of the detected marks, drawn over the photograph", "", "Powder printers"}};
}

Outcome calibrate_powder(const Arguments& arguments, Context& context) {
  for (const char* flag : {"--measured", "--bead", "--gap", "--exact-spacing"}) {
    if (arguments.has(flag)) return at_option(flag, "is of extrusion printers; this is a powder printer");
  }
  ChartRequest request{arguments.text("--machine"), arguments.text("-o,--output")};
  request.overwrite = arguments.has("--overwrite");
  double mass_mg = 0;
  std::int64_t drops = 0;
  for (const Status& status :
       {arguments.read("--drops", {1, 1e12}, drops), arguments.read("--layer", {0.01, 20, " mm"}, request.layer_mm),
        arguments.read("--weighed-mg", {1e-6, 1e9, " mg"}, mass_mg)}) {
    if (!status) return status;
  }
  request.drops = static_cast<std::uint64_t>(drops);
  if (mass_mg > 0 && drops == 0) return at_option("--weighed-mg", "is the mass of a number of drops; add --drops");
  if (arguments.has("--density") && mass_mg == 0) return at_option("--density", "is of weighed drops; add --weighed-mg");
  for (const char* flag : {"--chart", "--overlay"}) {
    if (arguments.has(flag) && !arguments.has("--scan")) return at_option(flag, "is of a photograph; add --scan");
  }
  if (arguments.has("--scan") && drops > 0) return at_option("--drops", "are weighed, not photographed; leave out --scan");
  if (arguments.has("--scan") && !arguments.has("--chart"))
    return at_option("--scan", "needs the chart that was printed; add --chart DIR");
  if (arguments.has("--scan")) return scan(request, arguments, context);
  return mass_mg > 0 ? weigh(request, mass_mg, arguments, context) : write_chart(request, arguments, context);
}

// --- extrusion printers, and the command

std::vector<std::string_view> names_of_all() {
  std::vector<std::string_view> names = names_of(shipped_extruders());
  for (const std::string_view name : names_of(shipped_machines())) names.push_back(name);
  return names;
}

CommandSpec calibrate_spec() {
  CommandSpec spec;
  spec.summary =
      "Computes the profile of a printer from measurements. Extrusion printers: writes test pieces for segmented lines;\n"
      "--measured then gives widths, spacings and speeds. Powder printers: writes a nozzle chart or a job of --drops; a\n"
      "photograph (--scan) or a mass (--weighed-mg) then gives blocked nozzles, offsets, dot gain or the drop volume.";
  spec.options = {{"--machine", "NAME|FILE", "printer; see lamina machines", "", "Machine", names_of_all()},
                  {"-o,--output", "DIR|FILE", "output directory; with measurements: profile to write", "", "Machine"},
                  {"--measured", "FILE", "completed widths.csv of the test pieces", "", "Measurements"},
                  {"--bead", "MM", "bead width in mm at 100 % extrusion; default: the nozzle", "", "Beads"},
                  {"--layer", "MM", "layer thickness in mm; default: 3/4 of the bead", "", "Beads"},
                  {"--gap", "MM", "target gap in mm next to thick beads; slightly negative bonds better", "0", "Beads"},
                  {"--exact-spacing", "", "exact spacings, not rounded to 0.01 mm as in Di Nisio (2022)", "", "Measurements"},
                  {"--overwrite", "", "replace a file that lamina did not write, or earlier test pieces", "", "Result"},
                  {"--json", "", "print the result as one JSON object on stdout", "", "Result"},
                  {"--quiet", "", "print errors only", "", "Result"}};
  for (OptionSpec& option : powder_calibration_options()) spec.options.push_back(std::move(option));
  spec.closing =
      "The steps of extrusion printers are those of Di Nisio (2022), Appendix A; docs/howto/calibrate.md describes them.\n\n"
      "Examples:\n"
      "  lamina calibrate --machine anet-a8 -o pieces\n"
      "  lamina calibrate --machine anet-a8 --measured pieces/widths.csv -o my-anet.toml\n"
      "  lamina extrude part.stl --machine my-anet.toml --fill segmented --extrusion 125 -o part.gcode\n"
      "  lamina calibrate --machine nuferbj -o chart\n"
      "  lamina calibrate --machine nuferbj --drops 1000000 -o drops\n"
      "  lamina calibrate --machine nuferbj --drops 1000000 --weighed-mg 52.5 -o my-nuferbj.toml";
  return spec;
}

Outcome say_pieces(const std::vector<std::string>& names, const Arguments& arguments, Context& context) {
  const std::string directory = arguments.text("-o,--output");
  if (!arguments.has("--quiet")) {
    context.say_text(fmt::format(
        "pieces    {} in {}: {}\nnext      print them in the order of STEPS.md, fill in widths.csv, then --measured {}/widths.csv\n",
        names.size(), one_line(directory), fmt::join(names, ", "), one_line(directory)));
  }
  if (!arguments.has("--json")) return {};
  return context.give({{"command", "calibrate"}, {"directory", directory}, {"pieces", names}});
}

Outcome say_profile(const CalibratedProfile& made, const Arguments& arguments, Context& context) {
  const std::string output = arguments.text("-o,--output");
  const segment::MeasuredMachine& found = made.found;
  const double flow = made.profile.machine.material.flow;
  Json json = {
      {"command", "calibrate"}, {"profile", output}, {"flow", flow}, {"repeated", Json::array()}, {"warnings", found.advice}};
  std::string text = found.flow ? fmt::format("flow      {:.3f}\n", flow) : std::string();
  for (const segment::Settled& s : found.settled) {
    text += fmt::format(
        "extrusion {:g} %: thick speed {:g} %, thick {:.3f}, thin {:.3f}, continuous {:.3f} mm, within {:.3f} mm along the part; S-C {:.4g}, C-C {:.4g} mm\n",
        s.widths.extrusion_percent, s.widths.thick_speed_percent, s.widths.thick_mm, s.widths.thin_mm, s.widths.continuous_mm,
        s.deviation_mm, s.spacing.segmented, s.spacing.continuous);
    json["repeated"].push_back({{"extrusion_percent", s.widths.extrusion_percent},
                                {"thick_speed_percent", s.widths.thick_speed_percent},
                                {"thick_mm", s.widths.thick_mm},
                                {"thin_mm", s.widths.thin_mm},
                                {"continuous_mm", s.widths.continuous_mm},
                                {"deviation_mm", s.deviation_mm},
                                {"spacing_sc_mm", s.spacing.segmented},
                                {"spacing_cc_mm", s.spacing.continuous}});
  }
  text += fmt::format("speeds    {} measured, extrusions {}\nprofile   {}\n", found.calibration.by_speed.size(),
                      found.calibration.by_extrusion.size(), one_line(output));
  for (const std::string& line : found.advice) text += fmt::format("warning   {}\n", line);
  if (!arguments.has("--quiet")) context.say_text(text);
  return arguments.has("--json") ? context.give(json) : Status();
}

Outcome run_calibrate(const Arguments& arguments, Context& context) {
  if (!arguments.operands.empty())
    return usage("'{}' is no option; the pieces are made here", one_line(arguments.operands.front()));
  if (!arguments.has("--machine"))
    return usage("--machine is missing; name a printer, as lamina extrude or lamina jet takes it");
  CalibrationRequest request{arguments.text("--machine"), arguments.text("-o,--output"), segment::preset_pieces(), false};
  if (request.directory.empty())
    return usage("-o is missing; name a directory for the test pieces, or with --measured the profile to be written");
  double gap = 0;
  for (const Status& status : {arguments.read("--bead", {0.01, 20, " mm"}, request.pieces.width_mm),
                               arguments.read("--layer", {0.01, 20, " mm"}, request.pieces.height_mm),
                               arguments.read("--gap", {-10, 10, " mm"}, gap)}) {
    if (!status) return status;
  }
  const auto extruder = names_extruder(request.machine);
  if (!extruder) return Error{extruder.error().fault, "--machine: " + extruder.error().message};
  if (!*extruder) return calibrate_powder(arguments, context);
  for (const OptionSpec& option : powder_calibration_options()) {
    if (arguments.has(option.flag)) return at_option(option.flag, "is of powder printers; this is an extrusion printer");
  }
  if (!arguments.has("--measured")) {
    for (const char* flag : {"--gap", "--exact-spacing"}) {
      if (arguments.has(flag)) return at_option(flag, "is of the profile that follows from widths; add --measured");
    }
    const std::atomic<bool>& cancel = context.cancel();
    keep_on_signals();
    request.overwrite = arguments.has("--overwrite");
    const auto names = write_test_pieces(request, cancel);
    if (!names) return names.error();
    return say_pieces(*names, arguments, context);
  }
  const auto made = calibrate_profile(request, arguments.text("--measured"), gap, arguments.has("--exact-spacing"));
  if (!made) return made.error();
  if (Status status = write_file(request.directory, made->toml); !status) return status;
  return say_profile(*made, arguments, context);
}

}  // namespace

const Command calibrate_command = {"calibrate", "write test prints of a printer; make its profile from measurements",
                                   calibrate_spec, run_calibrate};

}  // namespace lamina::pipeline
