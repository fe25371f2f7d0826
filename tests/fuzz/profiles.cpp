// Profiles of powder printers and of extrusion printers.
#include "pipeline/machine/profiles.h"
#include "pipeline/job/profiles/extruder.h"
#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

bool read_machine(std::string_view text) {
  const Result<Machine> machine = pipeline::read_machine(text, "printer.toml");
  if (!machine) return check_error(machine.error()), false;
  const std::string written = pipeline::machine_text(*machine);
  const Result<Machine> again = pipeline::read_machine(written, "again.toml");
  law(again.ok(), again.ok() ? "" : again.error().message.c_str());
  law(pipeline::machine_text(*again) == written, "a machine that was written reads back as another one");
  if (const auto resolved = pipeline::resolve_profile(*machine); !resolved) check_error(resolved.error());
  return true;
}

bool read_extruder(std::string_view text) {
  const Result<ExtruderProfile> profile = pipeline::read_extruder(text, "printer.toml");
  if (!profile) return check_error(profile.error()), false;
  const std::string written = pipeline::extruder_text(*profile);
  const Result<ExtruderProfile> again = pipeline::read_extruder(written, "again.toml");
  law(again.ok(), again.ok() ? "" : again.error().message.c_str());
  law(pipeline::extruder_text(*again) == written, "an extruder that was written reads back as another one");
  return true;
}

bool read_changes(std::string_view text) {
  pipeline::ProfileChanges changes;
  const std::string wrong = pipeline::read_changes(text, changes);
  if (!wrong.empty()) return check_line(wrong), false;
  const std::string written = pipeline::changes_text(changes);
  const auto tree = read_toml("set = " + (written.empty() ? "{}" : written), "set");
  law(tree.ok(), tree.ok() ? "" : tree.error().message.c_str());
  TextPosition at;
  pipeline::ProfileChanges again;
  const std::string what = pipeline::read_changes(*tree->find("set"), again, at);
  law(what.empty(), what.c_str());
  law(pipeline::changes_text(again) == written, "changes that were written read back as others");
  return true;
}

std::vector<std::string> machine_seeds() {
  std::vector<std::string> seeds;
  for (const auto& shipped : pipeline::shipped_machines()) seeds.emplace_back(shipped.text);
  seeds.push_back(pipeline::machine_text(*pipeline::read_machine(seeds.front(), "first")));
  return seeds;
}

std::vector<std::string> extruder_seeds() {
  std::vector<std::string> seeds;
  for (const auto& shipped : pipeline::shipped_extruders()) seeds.emplace_back(shipped.text);
  seeds.push_back(pipeline::extruder_text(*pipeline::read_extruder(seeds.front(), "first")));
  return seeds;
}

std::vector<std::string> change_seeds() { return {"fan.from_layer=2; bed.corner_mm=-110,-110", "material.flow=0.85"}; }

constexpr std::string_view kProfileSources =
    "pipeline/job/profiles stages/support/text pipeline/machine stages/program/head_grid";
const Registered kMachine({"machine", read_machine, machine_seeds, kProfileSources, ".toml", "toml.dict", 8192});
const Registered kExtruder({"extruder", read_extruder, extruder_seeds, kProfileSources, ".toml", "toml.dict", 8192});
const Registered kChanges({"profile_changes", read_changes, change_seeds, kProfileSources, "", "toml.dict", 512});

}  // namespace
}  // namespace lamina::fuzz
