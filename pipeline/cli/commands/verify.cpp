#include <fmt/format.h>

#include <algorithm>

#include "pipeline/check/verify.h"
#include "pipeline/cli/command.h"
#include "stages/data/text/json.h"
#include "stages/data/text/json_text.h"
#include "stages/data/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec verify_spec() {
  CommandSpec spec;
  spec.summary =
      "Compares a job's directory with its manifest: every layer's file is there, of the recorded size and hash, and\n"
      "decodes to the recorded pixels; the print program of each layer, carried out by a virtual machine, prints exactly\n"
      "that image; nothing else lies in layers/ and program/. Contours: every layer's bytes have the recorded hash.\n"
      "Exit code 5 if anything differs.";
  spec.operand = "DIR";
  spec.operand_meaning = "directory that lamina jet or lamina slice wrote; several are verified one after another";
  spec.options = {{"--quick", "", "sizes and hashes only, images are not decoded", "", ""},
                  {"--json", "", "print one JSON object for each directory on stdout", "", ""},
                  {"--quiet", "", "say nothing but faults", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina verify out\n"
      "  lamina verify --quick --json out | jq .fault_count";
  return spec;
}

Json replay_json(const VerifyReport& report) {
  const replay::Count& replay = report.replay;
  return {{"machine", report.machine},
          {"layers", report.replayed},
          {"drops", replay.drops},
          {"vectors", replay.vectors},
          {"sweeps", replay.sweeps},
          {"moved", report.moved},
          {"lost", report.lost},
          {"coverage", report.coverage},
          {"seconds", replay.seconds},
          {"scan_mm", replay.scan_mm},
          {"travel_mm", replay.travel_mm},
          {"fed_mm", replay.fed_mm},
          {"binder_mm3", report.material.binder_mm3},
          {"powder_mm3", report.material.powder_mm3},
          {"farthest_along_um", replay.farthest_along_um},
          {"farthest_across_um", replay.farthest_across_um}};
}

Json report_json(const VerifyReport& report) {
  Json faults = Json::array();
  for (const std::string& fault : report.faults) faults.push_back(one_line(fault));
  Json json = {{"command", "verify"},   {"directory", report.directory},     {"ok", report.ok()}, {"layers", report.layers},
               {"bytes", report.bytes}, {"fault_count", report.fault_count}, {"faults", faults}};
  if (!report.machine.empty()) json["replay"] = replay_json(report);
  return json;
}

// The machine's totals as text.
void say_replay(const VerifyReport& report, Context& context) {
  if (report.machine.empty() || report.replayed == 0) return;
  const replay::Count& replay = report.replay;
  context.say(fmt::format(
      "programs  {} layers replayed on {}: {}, {} drops in {} sweeps, {:.3f} % of the bed", readable_count(report.replayed),
      report.machine,
      report.moved + report.lost > 0 ? "every pixel fired once but those of blocked nozzles" : "every pixel fired once",
      readable_count(replay.drops), readable_count(replay.sweeps), 100 * report.coverage));
  if (report.moved + report.lost > 0) {
    context.say(fmt::format("blocked   {} pixels fired by a neighbouring nozzle, {} not at all, as recorded",
                            readable_count(report.moved), readable_count(report.lost)));
  }
  context.say(
      fmt::format("places    drops land up to {:.2f} um along and {:.2f} um across the scan from the centre of their pixel",
                  replay.farthest_along_um, replay.farthest_across_um));
  if (replay.travel_mm == 0 && replay.fed_mm[0] == 0 && replay.fed_mm[1] == 0) {
    // The program controls only the head; another controller drives the axes.
    context.say(fmt::format("machine   {:.1f} m scanned in {}; this dialect does not tell other movements nor powder",
                            replay.scan_mm / 1000, readable_seconds(replay.seconds)));
    context.say(fmt::format("material  {:.3f} ml of binder", report.material.binder_mm3 / 1000));
    return;
  }
  if (replay.seconds > 0) {
    context.say(fmt::format("machine   {:.2f} h, {:.1f} m scanned, {:.1f} m other travel", replay.seconds / 3600,
                            replay.scan_mm / 1000, replay.travel_mm / 1000));
  }
  context.say(fmt::format("material  {:.3f} ml of binder, {:.2f} cm3 of powder fed (solid), {:.2f} and {:.2f} mm of the vats",
                          report.material.binder_mm3 / 1000, report.material.powder_mm3 / 1000, replay.fed_mm[0],
                          replay.fed_mm[1]));
}

Outcome run_verify(const Arguments& arguments, Context& context) {
  if (arguments.operands.empty())
    return Error{Fault::kUsage, "no directory to verify; name one that lamina jet or lamina slice wrote"};
  int code = 0;
  for (const std::string& directory : arguments.operands) {
    const Result<VerifyReport> report = verify(directory, {.quick = arguments.has("--quick")});
    if (!report) {
      code = std::max(code, context.complain(report.error()));
      continue;
    }
    for (const std::string& fault : report->faults)
      context.complain({Fault::kVerification, fmt::format("{}: {}", directory, fault)});
    if (report->fault_count > report->faults.size()) {
      context.complain(
          {Fault::kVerification, fmt::format("{}: and {} more", directory, report->fault_count - report->faults.size())});
    }
    if (!report->ok()) code = std::max(code, static_cast<int>(Fault::kVerification));
    if (report->ok() && !arguments.has("--quiet")) {
      context.say(fmt::format("{}: {} layers, {}, all as the manifest says", directory, readable_count(report->layers),
                              readable_bytes(report->bytes)));
      say_replay(*report, context);
    }
    if (arguments.has("--json")) {
      if (Status status = context.give(report_json(*report)); !status) return status.error();
    }
  }
  return code;
}

}  // namespace

const Command verify_command = {"verify", "is a job's directory whole and true to its manifest", verify_spec, run_verify};

}  // namespace lamina::pipeline
