// lamina calibrate: test pieces for a printer, and the profile that follows from what was measured on them.
#include <fmt/format.h>

#include <cmath>
#include <span>

#include "pipeline/calibrate/calibrate.h"
#include "pipeline/cli/command.h"
#include "pipeline/text/json.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/names.h"
#include "pipeline/text/number_text.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

CommandSpec calibrate_spec() {
  CommandSpec spec;
  spec.summary =
      "Test pieces for segmented lines on a printer, as job files and toolpaths with a table to be filled in; then, from\n"
      "the measured widths, the printer's profile with its spacings and speeds.";
  spec.options = {
      {"--machine", "NAME|FILE", "extrusion printer; lamina extrude --help lists them", "", "Machine"},
      {"-o,--output", "DIR|FILE", "directory for the pieces; with --measured, the profile to be written", "", "Machine"},
      {"--measured", "FILE", "the widths.csv of the pieces, filled in", "", "Measurements"},
      {"--bead", "MM", "width of a bead at 100 %; the nozzle if absent", "", "Beads"},
      {"--layer", "MM", "thickness of a layer; three quarters of the bead if absent", "", "Beads"},
      {"--gap", "MM", "wanted between thick beads and their neighbours; slightly negative bonds better", "0", "Beads"},
      {"--exact-spacing", "", "spacings from the mean widths, not rounded to 0.01 mm as in the document", "", "Measurements"},
      {"--overwrite", "", "replace a file that lamina did not write", "", "Result"},
      {"--json", "", "print the result as one JSON object on stdout", "", "Result"},
      {"--quiet", "", "say nothing but errors", "", "Result"}};
  spec.closing =
      "The steps are those of Di Nisio (2022), Appendix A; docs/calibrate.md tells them.\n\n"
      "Examples:\n"
      "  lamina calibrate --machine anet-a8 -o pieces\n"
      "  lamina calibrate --machine anet-a8 --measured pieces/widths.csv -o my-anet.toml\n"
      "  lamina extrude part.stl --machine my-anet.toml --fill segmented --extrusion 125 -o part.gcode";
  return spec;
}

Outcome say_pieces(const std::vector<std::string>& names, const std::string& directory, bool json, bool quiet,
                   Context& context) {
  std::vector<std::string> quoted;
  for (const std::string& name : names) quoted.push_back(json_string(name));
  if (!quiet) {
    context.say_text(fmt::format(
        "pieces    {} in {}: {}\nnext      print them in the order of STEPS.md, fill in widths.csv, then --measured {}/widths.csv\n",
        names.size(), one_line(directory), fmt::join(names, ", "), one_line(directory)));
  }
  if (!json) return {};
  return context.give(Json::parse(fmt::format("{{\"command\":\"calibrate\",\"directory\":{},\"pieces\":[{}]}}\n",
                                              json_string(directory), fmt::join(quoted, ","))));
}

Outcome run_calibrate(const Arguments& arguments, Context& context) {
  const auto usage = [](const std::string& what) { return Error{Fault::kUsage, what}; };
  if (!arguments.operands.empty())
    return usage(fmt::format("'{}' is no option; the pieces are made here", one_line(arguments.operands.front())));
  if (!arguments.has("--machine")) return usage("--machine is missing; name an extrusion printer, as lamina extrude takes it");
  const std::string output = arguments.text("-o,--output"), machine = arguments.text("--machine");
  if (output.empty())
    return usage("-o is missing; name a directory for the test pieces, or with --measured the profile to be written");
  CalibrationRequest request = preset_calibration();
  request.machine = machine;
  request.directory = output;
  double gap = 0;
  const auto number = [&](const char* flag, double low, double high, double& target) {
    const std::string wrong = arguments.has(flag) ? read_number(arguments.text(flag), low, high, " mm", target) : std::string();
    return wrong.empty() ? wrong : fmt::format("{}: {}", flag, wrong);
  };
  for (const std::string& wrong : {number("--bead", 0.01, 20, request.width_mm), number("--layer", 0.01, 20, request.height_mm),
                                   number("--gap", -10, 10, gap)}) {
    if (!wrong.empty()) return usage(wrong);
  }
  const bool json = arguments.has("--json"), quiet = arguments.has("--quiet");
  if (!arguments.has("--measured")) {
    const auto names = write_test_pieces(request, context.cancel());
    if (!names) return names.error();
    return say_pieces(*names, output, json, quiet, context);
  }

  // --- measurements into a profile
  auto profile = find_extruder(machine);
  if (!profile) return usage("--machine: " + profile.error().message);
  const std::string path = arguments.text("--measured");
  const auto rows = read_widths(path);
  if (!rows) return rows.error();
  if (const auto pieces = test_pieces(request, *profile); !pieces) return pieces.error();  // resolves the bead
  segment::MeasuringSettings settings;
  settings.width_mm = request.width_mm;
  settings.height_mm = request.height_mm;
  settings.speed_mm_s = profile->machine.speed.print_mm_s;
  settings.flow = profile->machine.material.flow;
  settings.gap_mm = gap;
  settings.exact_spacing = arguments.has("--exact-spacing");
  const auto found = segment::calibrate(*rows, settings, fmt::format("measured on {}", profile->machine.name));
  if (!found) return Error{found.error().fault, fmt::format("{}: {}", path, found.error().message)};
  profile->calibration = found->calibration;
  profile->own_calibration = true;
  if (found->flow) profile->machine.material.flow = std::round(*found->flow * 1000) / 1000;
  const std::string toml = fmt::format("# {} with what was measured on it. Made by lamina calibrate.\n\n{}",
                                       one_line(profile->machine.name), extruder_text(*profile));
  if (const auto again = read_extruder(toml, output); !again)
    return Error{Fault::kInput, fmt::format("{}: {}", path, again.error().message)};
  if (Status status = write::write_file(output, std::as_bytes(std::span(toml))); !status) return status.error();

  std::string text, list;
  if (found->flow) text += fmt::format("flow      {:.3f}\n", profile->machine.material.flow);
  for (const segment::Settled& s : found->settled) {
    text += fmt::format(
        "extrusion {:g} %: thick speed {:g} %, thick {:.3f}, thin {:.3f}, continuous {:.3f} mm, within {:.3f} mm along the part; S-C {:.4g}, C-C {:.4g} mm\n",
        s.widths.extrusion_percent, s.widths.thick_speed_percent, s.widths.thick_mm, s.widths.thin_mm, s.widths.continuous_mm,
        s.deviation_mm, s.spacing.segmented, s.spacing.continuous);
    list += fmt::format(
        "{}{{\"extrusion_percent\":{},\"thick_speed_percent\":{},\"thick_mm\":{},\"thin_mm\":{},\"continuous_mm\":{},\"deviation_mm\":{},"
        "\"spacing_sc_mm\":{},\"spacing_cc_mm\":{}}}",
        list.empty() ? "" : ",", s.widths.extrusion_percent, s.widths.thick_speed_percent, s.widths.thick_mm, s.widths.thin_mm,
        s.widths.continuous_mm, s.deviation_mm, s.spacing.segmented, s.spacing.continuous);
  }
  text += fmt::format("speeds    {} measured, extrusions {}\nprofile   {}\n", found->calibration.by_speed.size(),
                      found->calibration.by_extrusion.size(), one_line(output));
  std::vector<std::string> advice;
  for (const std::string& line : found->advice) {
    text += fmt::format("warning   {}\n", line);
    advice.push_back(json_string(line));
  }
  if (!quiet) context.say_text(text);
  if (json) {
    const Status status = context.give(Json::parse(
        fmt::format("{{\"command\":\"calibrate\",\"profile\":{},\"flow\":{},\"repeated\":[{}],\"warnings\":[{}]}}\n",
                    json_string(output), profile->machine.material.flow, list, fmt::join(advice, ","))));
    if (!status) return status.error();
  }
  return 0;
}

}  // namespace

const Command calibrate_command = {"calibrate",
                                   "test pieces of an extrusion printer, and its profile from what was measured on them",
                                   calibrate_spec, run_calibrate};

}  // namespace lamina::pipeline
