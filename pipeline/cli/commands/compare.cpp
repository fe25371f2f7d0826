// lamina compare: compares a photograph of a printed layer with the layer.
#include <fmt/format.h>

#include "pipeline/check/job_files.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/other_programs.h"
#include "pipeline/job/errors.h"
#include "pipeline/machine/profiles.h"
#include "stages/data/units.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {
namespace {

CommandSpec compare_spec() {
  CommandSpec spec;
  spec.summary =
      "Locates a layer in its photograph. Reports missing stripes along the scan, and the expected and detected area of\n"
      "each connected part. Exit code 5 if a stripe is missing.";
  spec.operand = "LAYER PHOTO";
  spec.operand_meaning = "layer image of lamina jet, and its photograph from above (PNG, JPEG or TIFF)";
  spec.options = {
      {"--pixel", "UM", "pixel size of the photograph in micrometres, within 5 %", "100", ""},
      {"--machine", "NAME|FILE", "printer that defines the scan axis; default: x", "", "", names_of(shipped_machines())},
      {"--json", "", "print the result as one JSON object on stdout", "", ""},
      {"--quiet", "", "print errors only", "", ""}};
  spec.closing = "Examples:\n  lamina compare out/layers/000002.tif photo.png --pixel 254";
  return spec;
}

Outcome run_compare(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 2) return usage("name the image of a layer, and a photograph of it");
  double photo_um = 100;
  if (Status status = arguments.read("--pixel", {1, 2000, " um"}, photo_um); !status) return status;
  const auto machine = arguments.has("--machine") ? find_machine(arguments.text("--machine")) : Machine();
  if (!machine) return machine.error();
  const auto layer = printed_pixels(arguments.operands[0]);
  if (!layer) return layer.error();
  if (!(layer->dpi_x > 0) || !(layer->dpi_y > 0))
    return failure(Fault::kInput, "{}: has no resolution; use an image that lamina wrote", arguments.operands[0]);
  const auto reported = scanned("compare",
                                {{"photo", arguments.operands[1]},
                                 {"photo_um", photo_um},
                                 {"scan_along_x", machine->mounting.scan_axis == ScanAxis::kX},
                                 {"pixel_nm", {kNmPerInch / layer->dpi_x, kNmPerInch / layer->dpi_y}},
                                 {"columns", layer->runs.columns},
                                 {"row_offset", layer->runs.row_offset},
                                 {"change", layer->runs.change}},
                                "");
  if (!reported) return reported.error();
  Json json = parse_json(*reported);
  const auto number = [](const Json& value) { return value.get<double>(); };
  const char* axis = machine->mounting.scan_axis == ScanAxis::kX ? "from the back" : "from the left";
  Answer answer(arguments, context);
  answer.say(fmt::format("photo     rotated by {:.1f} degrees, correlation {:.2f}", number(json["rotation_deg"]),
                         number(json["likeness"])));
  for (const Json& rotation : json["also_deg"])
    answer.say(fmt::format("symmetric the layer fits as well at {:.0f} degrees: positions may be turned by it, and stripes missed",
                           number(rotation)));
  for (const Json& band : json["missing"])
    answer.say(fmt::format("missing   {:.2f} mm of {:.2f} to {:.2f} mm {}", number(band["missing_mm"]), number(band["from_mm"]),
                           number(band["to_mm"]), axis));
  for (const Json& body : json["bodies"])
    answer.say(fmt::format("area      {:.2f} of {:.2f} mm2 about {:.1f}, {:.1f} mm from the left and the back",
                           number(body["detected_mm2"]), number(body["expected_mm2"]), number(body["x_mm"]),
                           number(body["y_mm"])));
  for (const Json& ink : json["extra"])
    answer.say(
        fmt::format("extra     {:.2f} mm2 about {:.1f}, {:.1f} mm from the left and the back, where the layer has no ink",
                    number(ink["mm2"]), number(ink["x_mm"]), number(ink["y_mm"])));
  if (Status status = answer.status(); !status) return status;
  const bool whole = json["missing"].empty();
  json["command"] = "compare";
  if (arguments.has("--json")) {
    if (Status status = context.give(json); !status) return status;
  }
  return whole ? 0 : static_cast<int>(Fault::kVerification);
}

}  // namespace

const Command compare_command = {"compare", "compare the photograph of a printed layer with its bitmap", compare_spec,
                                 run_compare};

}  // namespace lamina::pipeline
