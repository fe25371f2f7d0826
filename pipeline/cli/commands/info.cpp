#include <fmt/format.h>

#include <algorithm>

#include "pipeline/cli/command.h"
#include "pipeline/job/keys.h"
#include "pipeline/plan/scene.h"
#include "pipeline/show/info.h"
#include "pipeline/text/json.h"

namespace lamina::pipeline {
namespace {

CommandSpec info_spec() {
  CommandSpec spec;
  spec.summary =
      "Says what is in a part file: triangles, shells, size, volume, whether it is closed and where it is not, and what\n"
      "lamina jet will do about that. Nothing is written.";
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF file, also gzipped STL and OBJ; as many as you like";
  spec.options = {{"--unit", "UNIT", "of STL and OBJ, which carry none: mm, cm, m, um, inch, foot", "mm", ""},
                  {"--scale", "S|X,Y,Z", "factors per axis of the file", "1", ""},
                  {"--rotate", "X,Y,Z", "degrees about x, then y, then z", "0,0,0", ""},
                  {"--drop-bad", "", "drop facets with coordinates that are no numbers", "", ""},
                  {"--weld", "UM", "repair joins open edges that are at most this far apart, in micrometres", "5", ""},
                  {"--json", "", "print one JSON object for each part on stdout", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina info bracket.stl\n"
      "  lamina info --unit inch housing.stl\n"
      "  lamina info --json *.stl | jq -r 'select(.closed | not) | .path'";
  return spec;
}

/// The keys of a job that the options stand for, read as lamina jet reads them.
Status set_keys(const Arguments& arguments, Job& job) {
  const auto refused = [](std::string_view flag, const std::string& wrong) {
    return Error{Fault::kUsage, fmt::format("{}: {}", flag, wrong)};
  };
  for (const PartKey& key : part_keys()) {
    if (key.flag.empty() || !arguments.has(key.flag)) continue;
    const std::string wrong = key.read(arguments.text(key.flag), job.parts.front());
    if (!wrong.empty()) return refused(key.flag, wrong);
  }
  for (const JobKey& key : job_keys()) {
    if (key.flag.empty() || !arguments.has(key.flag)) continue;
    const std::string wrong = key.read(key.value.empty() ? key.switch_text : arguments.text(key.flag), job);
    if (!wrong.empty()) return refused(key.flag, wrong);
  }
  return {};
}

Outcome run_info(const Arguments& arguments, Context& context) {
  if (arguments.operands.empty()) return Error{Fault::kUsage, "no part to look at; name an STL, OBJ or 3MF file"};
  int code = 0;
  for (const std::string& path : arguments.operands) {
    Job job;
    job.parts.emplace_back().path = path;
    if (Status status = set_keys(arguments, job); !status) return status.error();
    const load::LoadOptions options = load_options(job, job.parts.front());
    const Result<std::string> page =
        arguments.has("--json") ? describe_part_json(path, options) : describe_part_text(path, options);
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
