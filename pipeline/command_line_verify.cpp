#include <fmt/format.h>

#include "pipeline/command_line.h"
#include "pipeline/console.h"
#include "pipeline/json_text.h"
#include "pipeline/verify.h"

namespace lamina::pipeline {
namespace {

CommandSpec verify_spec() {
  CommandSpec spec;
  spec.name = "verify";
  spec.summary =
      "Compares a job's directory with its manifest: every layer's file is there, of the recorded size and hash, and\n"
      "decodes to the recorded pixels; nothing else lies in layers/. Exit code 5 if anything differs.";
  spec.operand = "DIR";
  spec.operand_meaning = "directory that lamina jet wrote; several are verified one after another";
  spec.options = {{"--quick", "", "sizes and hashes only, images are not decoded", "", ""},
                  {"--json", "", "print one JSON object for each directory on stdout", "", ""},
                  {"--quiet", "", "say nothing but faults", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina verify out\n"
      "  lamina verify --quick --json out | jq .fault_count";
  return spec;
}

std::string report_json(const VerifyReport& report) {
  std::string faults;
  for (const std::string& fault : report.faults) faults += (faults.empty() ? "" : ",") + json_string(one_line(fault));
  return fmt::format(
      "{{\"command\":\"verify\",\"directory\":{},\"ok\":{},\"layers\":{},\"bytes\":{},\"fault_count\":{},\"faults\":[{}]}}\n",
      json_string(report.directory), report.ok(), report.layers, report.bytes, report.fault_count, faults);
}

}  // namespace

int run_verify_command(const std::vector<std::string>& texts) {
  const Result<Arguments> arguments = read_arguments(verify_spec(), texts);
  if (!arguments) return fail(arguments.error());
  if (arguments->help) {
    const Status status = print(*arguments->help);
    return status ? 0 : fail(status.error());
  }
  if (arguments->operands.empty()) return fail({Fault::kUsage, "no directory to verify; name one that lamina jet wrote"});
  int code = 0;
  for (const std::string& directory : arguments->operands) {
    const Result<VerifyReport> report = verify(directory, {.quick = arguments->has("--quick")});
    if (!report) {
      code = std::max(code, fail(report.error()));
      continue;
    }
    for (const std::string& fault : report->faults) say(fmt::format("lamina: {}: {}", directory, fault));
    if (report->fault_count > report->faults.size()) {
      say(fmt::format("lamina: {}: and {} more", directory, report->fault_count - report->faults.size()));
    }
    if (!report->ok()) code = std::max(code, static_cast<int>(Fault::kVerification));
    if (report->ok() && !arguments->has("--quiet")) {
      say(fmt::format("{}: {} layers, {}, all as the manifest says", directory, readable_count(report->layers),
                      readable_bytes(report->bytes)));
    }
    if (arguments->has("--json")) {
      if (Status status = print(report_json(*report)); !status) return fail(status.error());
    }
  }
  return code;
}

}  // namespace lamina::pipeline
