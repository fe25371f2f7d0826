#include <fmt/format.h>

#include <algorithm>

#include "pipeline/batch/check_batch.h"
#include "pipeline/batch/whole.h"
#include "pipeline/check/toolpaths.h"
#include "pipeline/check/verify.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "pipeline/report/replay_text.h"
#include "stages/checks/layer_warnings.h"
#include "stages/support/io/container.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec verify_spec() {
  CommandSpec spec;
  spec.summary =
      "Checks a job: file sizes and hashes, decoded pixels, files that do not belong to it, and a replay of the print\n"
      "program by the firmware's rules. G-code, also of other slicers, is replayed: heat, filament, layers, speeds and the\n"
      "machine's limits. Of a batch, every output is compared with the record and verified. Exit code 5 for faults.";
  spec.operand = "DIR|GCODE|SML";
  spec.operand_meaning = "directories of lamina jet, slice or batch, SML files, or G-code files of any slicer";
  spec.options = {{"--quote", "CSV", "write material and cost per part as CSV (one directory)", "", ""},
                  {"--overwrite", "", "replace a file that lamina did not write", "", ""},
                  {"--machine", "NAME|FILE", "extrusion printer whose limits G-code must keep", "", ""},
                  {"--material", "NAME|FILE", "its material, with a melt rate", "", ""},
                  {"--filament", "MM", "filament diameter; default: as the file states, else 1.75", "", ""},
                  {"--model", "FILE", "part of a G-code file: volumes and outlines by layer", "", ""},
                  {"--parts", "DIR", "folder or file of parts, to plan the job again; repeatable", "", ""},
                  {"--quick", "", "check sizes and hashes only, without images or a replay", "", ""},
                  {"--memory", "SIZE", "memory limit for layers in flight: 256M, 1G", "1G", ""},
                  {"--json", "", "print one JSON object per directory on stdout", "", ""},
                  {"--quiet", "", "print faults only", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina verify out\n"
      "  lamina verify out --quote quote.csv      what it took, from what the files make the machine do\n"
      "  lamina verify part.gcode --machine marlin\n"
      "  lamina verify --quick --json out | jq .fault_count";
  return spec;
}

replay::Totals totals_of(const VerifyReport& report) {
  return {report.machine, report.replayed, report.replay, report.moved, report.lost, report.material, report.coverage};
}

Json report_json(const VerifyReport& report) {
  Json faults = Json::array();
  for (const std::string& fault : report.faults) faults.push_back(one_line(fault));
  Json json = {{"command", "verify"},   {"directory", report.directory},     {"ok", report.ok()}, {"layers", report.layers},
               {"bytes", report.bytes}, {"fault_count", report.fault_count}, {"faults", faults}};
  if (!report.machine.empty()) json["replay"] = replay::totals_json(totals_of(report));
  if (report.toolpaths) json["toolpaths"] = report.toolpaths->json();
  if (const Json* use = report.use.facts.find("use")) json["use"] = *use;
  for (const UnfedPowder& powder : report.unfed) {
    json["unfed"].push_back({{"material", powder.name}, {"pixels", powder.pixels}, {"layers", powder.layers}});
  }
  return json;
}

/// errors  kUsage: options of G-code files with a directory
Status check_toolpath_options(const Arguments& arguments) {
  for (const std::string& operand : arguments.operands) {
    if (!is_job_folder(operand)) continue;
    for (const char* option : {"--machine", "--material", "--filament", "--model", "--parts"}) {
      if (arguments.has(option)) return at_option(option, "is of G-code files, and " + operand + " is a job of images");
    }
  }
  if (arguments.has("--material") && !arguments.has("--machine")) return at_option("--material", "needs --machine");
  return {};
}

/// The sums of a replayed G-code file, also of one with faults.
void say_toolpaths(const VerifyReport& report, Answer& answer) {
  if (!report.toolpaths) return;
  for (const auto& [name, what] : report.toolpaths->lines()) answer.say(fmt::format("{:<10}{}", name, what));
}

/// Verifies the directory of a batch. returns  the exit code
Outcome verify_batch(const std::string& directory, const VerifyOptions& options, const Arguments& arguments, Context& context) {
  if (arguments.has("--quote")) return at_option("--quote", "is of one job, and " + directory + " is of a batch");
  const Result<BatchCheck> check = check_batch(directory, options);
  if (!check) return check.error();
  complain_of(*check, directory, context);
  Answer answer(arguments, context);
  if (check->ok()) {
    answer.say(fmt::format("{}: {} jobs, {} files, {}, all as the record says", directory, readable_count(check->jobs),
                           readable_count(check->files), readable_bytes(check->bytes)));
    if (check->failed > 0) answer.say(fmt::format("{}: {} jobs failed and have no output", directory, check->failed));
  }
  if (Status status = answer.status(); !status) return status;
  if (arguments.has("--json")) {
    const Json json = {
        {"command", "verify"},     {"directory", directory}, {"ok", check->ok()},     {"jobs", check->jobs},
        {"failed", check->failed}, {"files", check->files},  {"bytes", check->bytes}, {"fault_count", check->fault_count},
        {"faults", check->faults}};
    if (Status status = context.give(json); !status) return status;
  }
  return check->ok() ? 0 : static_cast<int>(Fault::kVerification);
}

Outcome run_verify(const Arguments& arguments, Context& context) {
  if (arguments.operands.empty()) return usage("no directory to verify; name one that lamina jet or lamina slice wrote");
  if (arguments.has("--quote") && arguments.operands.size() > 1)
    return at_option("--quote", "is of one directory; verify them one by one");
  if (arguments.has("--quote") && arguments.has("--quick"))
    return at_option("--quote", "needs the replay of programs; remove --quick");
  if (Status status = check_quote(arguments, arguments.operands.front()); !status) return status;
  if (Status status = check_folder("--quote", arguments.text("--quote")); !status) return status;
  if (Status status = check_toolpath_options(arguments); !status) return status;
  VerifyOptions options;
  options.quick = arguments.has("--quick");
  if (Status status = arguments.read("--memory", read_bytes, options.memory_bytes); !status) return status;
  options.toolpaths.machine = arguments.text("--machine");
  options.toolpaths.model = arguments.text("--model");
  options.toolpaths.parts = arguments.all("--parts");
  options.toolpaths.material = arguments.text("--material");
  std::string (*const read_diameter)(std::string_view, double&) = [](std::string_view text, double& mm) {
    return read_number(text, 0.5, 10, " mm", mm);
  };
  if (Status status = arguments.read("--filament", read_diameter, options.toolpaths.filament_mm); !status) return status;
  int code = 0;
  Answer answer(arguments, context);
  for (const std::string& directory : arguments.operands) {
    if (is_batch_directory(directory)) {
      const Outcome outcome = verify_batch(directory, options, arguments, context);
      code = std::max(code, outcome.error ? context.complain(*outcome.error) : outcome.code);
      continue;
    }
    const Result<VerifyReport> report = verify(directory, options);
    if (!report) {
      code = std::max(code, context.complain(report.error()));
      continue;
    }
    complain_of(*report, directory, context);
    if (!report->ok()) code = std::max(code, static_cast<int>(Fault::kVerification));
    if (report->ok()) {
      answer.say(fmt::format("{}: {} layers, {}, {}", directory, readable_count(report->layers), readable_bytes(report->bytes),
                             report->recorded ? "all as the manifest says" : "no fault"));
      if (report->replayed > 0) {
        for (const std::string& line : replay::totals_text(totals_of(*report))) answer.say(line);
        for (const auto& [name, what] : report->use.results)
          answer.say(fmt::format("{:<10}{}", name == "material" ? "used" : name, what));
        std::vector<Warning> warnings;
        for (const UnfedPowder& powder : report->unfed) checks::warn_of_unfed(powder, warnings);
        for (const Warning& warning : warnings) answer.say("warning   " + one_line(warning.text));
      }
    }
    say_toolpaths(*report, answer);
    if (Status status = answer.status(); !status) return status;
    if (report->ok()) {
      if (Status status = write_quote(arguments, report->use.quote); !status) return status;
    }
    if (arguments.has("--json")) {
      if (Status status = context.give(report_json(*report)); !status) return status.error();
    }
  }
  return code;
}

}  // namespace

const Command verify_command = {"verify", "check the files of a job and replay its print program", verify_spec, run_verify};

}  // namespace lamina::pipeline
