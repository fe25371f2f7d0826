#include <fmt/format.h>

#include <algorithm>

#include "pipeline/calibrate/laid_look.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/cli/needs.h"
#include "pipeline/plan/scene.h"
#include "stages/data/text/json.h"
#include "stages/data/text/readable.h"
#include "stages/load/info/info.h"
#include "stages/slice/surplus.h"

namespace lamina::pipeline {
namespace {

CommandSpec info_spec() {
  CommandSpec spec;
  spec.summary =
      "Says what is in a part file: triangles, shells, size, volume, whether it is closed and where it is not, and what\n"
      "lamina jet will do about that. Of G-code: what is fed, and the pores that its beads leave. Nothing is written.";
  spec.operand = "PART|GCODE";
  spec.operand_meaning = "STL, OBJ or 3MF file, also gzipped STL and OBJ, or toolpaths, as in part.gcode; as many as you like";
  spec.options = {{"--unit",
                   "UNIT",
                   "of STL and OBJ, which carry none: mm, cm, m, um, inch, foot",
                   "mm",
                   "",
                   {"mm", "cm", "m", "um", "inch", "foot"}},
                  {"--scale", "S|X,Y,Z", "factors per axis of the file", "1", ""},
                  {"--rotate", "X,Y,Z", "degrees about x, then y, then z", "0,0,0", ""},
                  {"--drop-bad", "", "drop facets with coordinates that are no numbers", "", ""},
                  {"--repair",
                   "MODE",
                   "how open meshes are closed: auto, winding (approximate) or off",
                   "auto",
                   "",
                   {"auto", "winding", "off"}},
                  {"--weld", "UM", "repair joins open edges this far apart, in micrometres; 5 grows by itself", "5", ""},
                  {"--density", "G/CM3", "of the filament of toolpaths, where the file tells none", "", ""},
                  {"--json", "", "print one JSON object for each part on stdout", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina info bracket.stl\n"
      "  lamina info --unit inch housing.stl\n"
      "  lamina info part.gcode                     volume fed, weight, porosity, pores by width and length\n"
      "  lamina info --json *.stl | jq -r 'select(.closed | not) | .path'";
  return spec;
}

Status tell_print(const std::string& path, double density_g_cm3, const Arguments& arguments, Context& context) {
  const Result<LaidPrint> print = look_at_print(path, density_g_cm3);
  if (!print) return print.error();
  if (!arguments.has("--json")) return context.print(one_line(path) + "\n" + as_text(*print));
  Json json = {{"path", path}};
  json.update(as_json(*print));
  return context.give(json);
}

Outcome run_info(const Arguments& arguments, Context& context) {
  if (arguments.operands.empty()) return Error{Fault::kUsage, "no part to look at; name an STL, OBJ or 3MF file"};
  // Read as lamina jet reads them.
  const Result<Job> job = read_job_options({"part", "load"}, arguments);
  if (!job) return job.error();
  if (Status status = check_needs(Product::kImages, arguments, *job); !status) return status;
  double density_g_cm3 = 0;
  if (Status status = arguments.read("--density", {0.1, 25}, density_g_cm3); !status) return status;
  const bool parts = !std::ranges::all_of(arguments.operands, names_toolpaths);
  if (arguments.has("--density") && !std::ranges::any_of(arguments.operands, names_toolpaths))
    return at_option("--density", "is of toolpaths; parts have no filament");
  for (const char* flag : {"--unit", "--scale", "--rotate", "--drop-bad", "--repair", "--weld"})
    if (arguments.has(flag) && !parts) return at_option(flag, "is of parts, not of toolpaths");
  int code = 0;
  for (const PartRequest& part : job->parts) {
    if (names_toolpaths(part.path)) {
      if (Status status = tell_print(part.path, density_g_cm3, arguments, context); !status)
        code = std::max(code, context.complain(status.error()));
      continue;
    }
    const load::LoadOptions options = load_options(*job, part);
    const Result<std::string> page = (arguments.has("--json") ? load::describe_part_json : load::describe_part_text)(
        part.path, options, slice::surplus_areas);
    if (!page) {
      code = std::max(code, context.complain(page.error()));
      continue;
    }
    const Status status = arguments.has("--json") ? context.give(Json::parse(*page)) : context.print(*page);
    if (!status) return status.error();
  }
  return code;
}

}  // namespace

const Command info_command = {"info", "what is in a part file, is it closed, and where is it not", info_spec, run_info};

}  // namespace lamina::pipeline
