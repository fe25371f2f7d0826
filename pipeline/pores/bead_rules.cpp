#include "pipeline/pores/bead_rules.h"

#include <fmt/format.h>

#include "pipeline/machine/profiles.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// The shipped printer of that name. errors  those of read_extruder
Result<std::optional<Extruder>> shipped_extruder_named(const std::string& name) {
  for (const ShippedProfile& shipped : shipped_extruders()) {
    const Result<ExtruderProfile> profile = read_extruder(shipped.text, std::string(shipped.name));
    if (!profile) return profile.error();
    if (profile->machine.name == name) return std::optional<Extruder>(profile->machine);
  }
  return std::optional<Extruder>();
}

bead::DepositionRules rules_of(const Extruder& machine) {
  bead::DepositionRules rules;
  rules.machine.tau_s = machine.material.lag_s;
  rules.machine.acceleration_mm_s2 = machine.speed.acceleration_mm_s2;
  rules.corner_mm_s = machine.speed.corner_mm_s;
  rules.feed_ratio = machine.material.feed_ratio;
  rules.usual_mm_s = machine.speed.print_mm_s;
  return rules;
}

}  // namespace

Result<BeadRules> bead_rules(const formats::GcodeFile& file, const std::string& beads, const std::string& machine) {
  if (!beads.empty() && beads != "deposited" && beads != "spread" && beads != "stated")
    return Error{Fault::kUsage, fmt::format("--beads: '{}' is none of laid, spread, told", one_line(beads))};
  const std::string reported =
      file.states_widths() ? "widths are those that the file tells" : "widths are those of what is fed";
  if (beads == "stated" && !machine.empty())
    return Error{Fault::kUsage, "--machine does nothing beside --beads told; leave one out"};
  if (beads == "stated") return BeadRules{std::nullopt, reported};
  std::optional<Extruder> printer;
  if (!machine.empty()) {
    const Result<ExtruderProfile> profile = find_extruder(machine);
    if (!profile) return profile.error();
    printer = profile->machine;
  } else if (!file.machine().empty()) {
    Result<std::optional<Extruder>> named = shipped_extruder_named(file.machine());
    if (!named) return named.error();
    printer = std::move(*named);
  }
  if (printer) {
    BeadRules found{rules_of(*printer), fmt::format("widths are those that {} lays: lag {:g} s, {:g} mm/s2", printer->name,
                                                    printer->material.lag_s, printer->speed.acceleration_mm_s2)};
    found.rules->spread = beads != "deposited";
    return found;
  }
  if (!beads.empty())
    return Error{Fault::kUsage,
                 fmt::format("--beads {}: the file names no printer that is shipped; add --machine NAME", beads)};
  return BeadRules{std::nullopt, reported};
}

}  // namespace lamina::pipeline
