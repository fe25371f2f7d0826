#include <fmt/format.h>

#include <filesystem>

#include "pipeline/cli/command.h"
#include "pipeline/job/errors.h"
#include "pipeline/pores/pore_analysis.h"
#include "pipeline/show/report.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec report_spec() {
  CommandSpec spec;
  spec.summary =
      "Writes one HTML page about a finished job: layers to browse, zoom and pan, the parts from three sides, area,\n"
      "thickness and time over the height, warnings, the job and all hashes. The page needs no network and no other file.";
  spec.operand = "DIR|GCODE";
  spec.operand_meaning = "finished directory of lamina jet, or G-code file of lamina extrude with its manifest";
  spec.options = {{"-o,--output", "HTML", "page to write, .html or .htm", "", ""},
                  {"--max-bytes", "SIZE", "max size of the page; layers are omitted evenly to fit", "19M", ""},
                  {"--parts", "DIR", "folder or file of the parts, for the three views; repeatable", "", ""},
                  {"--memory", "SIZE", "memory limit for layers in flight: 256M, 1G", "1G", ""},
                  {"--overwrite", "", "replace a file that lamina did not write", "", ""},
                  {"--quiet", "", "print errors only", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina report out -o report.html\n"
      "  lamina report out -o report.html --parts parts/      the parts themselves from three sides\n"
      "  lamina report out -o small.html --max-bytes 2M      for a mail\n"
      "  lamina report part.gcode -o part.html                toolpaths, drawn in their beads' true widths";
  return spec;
}

/// Whether a browser opens a file of this name as a page. Other names are refused, because the page could replace a part,
/// an image or a manifest.
bool is_page_name(const std::string& path) {
  const std::string ending = lower_case(std::filesystem::path(path).extension().string());
  return ending == ".html" || ending == ".htm";
}

Outcome run_report(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 1)
    return usage("name one finished directory of lamina jet, or one G-code file of lamina extrude");
  const std::string output = arguments.text("-o,--output");
  if (output.empty()) return usage("-o HTML is missing; name the page");
  if (!is_page_name(output)) return usage("-o {}: the page is HTML; give it a name that ends in .html", output);
  ReportOptions options;
  if (Status status = arguments.read("--max-bytes", read_bytes, options.size_limit); !status) return status;
  if (Status status = arguments.read("--memory", read_bytes, options.memory_bytes); !status) return status;
  options.parts = arguments.all("--parts");
  std::error_code ignored;
  if (!options.parts.empty() && is_file(arguments.operands.front()) && !is_container(arguments.operands.front()))
    return at_option("--parts", "is of jobs of images; a page of toolpaths has no views of the parts, leave it out");
  for (const std::string& parts : options.parts) {
    if (!std::filesystem::exists(parts, ignored)) return failure(Fault::kInput, "--parts: {}: no such file or folder", parts);
  }
  AnalysisPage deposited = analysis_page(arguments.operands.front());
  options.deposited = std::move(deposited.text);
  options.deposited_svg = std::move(deposited.svg);
  const Result<Report> report = make_report(arguments.operands.front(), options);
  if (!report) return report.error();
  if (Status status = write_file(output, report->page); !status) return status.error();
  Answer answer(arguments, context);
  answer.say(
      fmt::format("{}: {} of {} layers shown, {}", output, report->held, report->layers, readable_bytes(report->page.size())));
  if (const std::uint64_t bytes = report->page.size(); bytes > options.size_limit && !arguments.has("--quiet"))
    context.say(
        fmt::format("note: {} takes {}, more than --max-bytes; no page of this job is smaller", output, readable_bytes(bytes)));
  if (!report->without_parts.empty()) answer.say("views are of the layers: " + report->without_parts);
  return answer.status();
}

}  // namespace

const Command report_command = {"report", "write an HTML page about a finished job: layers, plots, warnings, hashes",
                                report_spec, run_report};

}  // namespace lamina::pipeline
