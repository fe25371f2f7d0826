#include "pipeline/cli/commands/calibrate_powder.h"

#include <fmt/format.h>

#include "pipeline/calibrate/chart_job.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/scan_program.h"
#include "pipeline/machine/profiles.h"
#include "stages/calibration/chart/draw.h"
#include "stages/formats/chart/chart.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/file_target.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

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

}  // namespace

std::vector<OptionSpec> powder_calibration_options() {
  return {{"--drops", "N", "powder printer: a job of so many drops, to be weighed", "", "Powder printers"},
          {"--weighed-mg", "MG", "mass of those --drops: the volume of a drop for the profile", "", "Powder printers"},
          {"--density", "G/ML", "of the binder", "1", "Powder printers"},
          {"--scan", "PHOTO", "photograph of a printed chart: blocked nozzles, offsets and dot gain for the profile", "",
           "Powder printers"},
          {"--chart", "DIR|FILE", "of that chart, as an earlier call wrote it", "", "Powder printers"},
          {"--overlay", "PNG", "what was seen, drawn over the photograph", "", "Powder printers"}};
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

}  // namespace lamina::pipeline
