#include <fmt/format.h>

#include <algorithm>

#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/cli/needs.h"
#include "pipeline/plan/scene.h"
#include "stages/data/text/json.h"
#include "stages/load/info/info.h"
#include "stages/slice/surplus.h"

namespace lamina::pipeline {
namespace {

CommandSpec info_spec() {
  CommandSpec spec;
  spec.summary =
      "Says what is in a part file: triangles, shells, size, volume, whether it is closed and where it is not, and what\n"
      "lamina jet will do about that. Nothing is written.";
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF file, also gzipped STL and OBJ; as many as you like";
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
                  {"--json", "", "print one JSON object for each part on stdout", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina info bracket.stl\n"
      "  lamina info --unit inch housing.stl\n"
      "  lamina info --json *.stl | jq -r 'select(.closed | not) | .path'";
  return spec;
}

Outcome run_info(const Arguments& arguments, Context& context) {
  if (arguments.operands.empty()) return Error{Fault::kUsage, "no part to look at; name an STL, OBJ or 3MF file"};
  // Read as lamina jet reads them.
  const Result<Job> job = read_job_options({"part", "load"}, arguments);
  if (!job) return job.error();
  if (Status status = check_needs(Product::kImages, arguments, *job); !status) return status;
  int code = 0;
  for (const PartRequest& part : job->parts) {
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
