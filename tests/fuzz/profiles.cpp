// Profiles of powder printers and of extrusion printers.
#include "pipeline/machine/profiles.h"
#include "pipeline/job/profiles/extruder.h"
#include "pipeline/machine/import/import_profile.h"
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

/// Settings of another slicer; presets inherit from files, and there are none.
bool read_import(std::string_view text) {
  pipeline::ImportRequest request;
  request.plain_code = text.size() % 2 == 0;
  if (text.find("[printer:a]") != std::string_view::npos) request.choice.printer = "a";
  const auto imported = pipeline::import_profile(text, "/nowhere/settings", request);
  if (!imported) return check_error(imported.error()), false;
  const auto keys = read_toml(imported->text, "imported.toml");
  law(keys.ok(), keys.ok() ? "" : keys.error().message.c_str());
  const bool printer = keys->find("machine") != nullptr;
  law(printer || keys->find("material") != nullptr, "neither a printer nor a material was imported");
  const auto profile = pipeline::read_extruder((printer ? "" : "[machine]\nname = \"x\"\n") + imported->text, "imported.toml");
  law(profile.ok(), profile.ok() ? "" : profile.error().message.c_str());
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
  for (const auto& shipped : pipeline::shipped_extruders()) {
    if (shipped.text.find("inherits") == std::string_view::npos) seeds.emplace_back(shipped.text);
  }
  seeds.push_back(pipeline::extruder_text(*pipeline::read_extruder(seeds.front(), "first")));
  return seeds;
}

std::vector<std::string> import_seeds() {
  return {
      "bed_shape = 0x0,20x0,20x30,0x30\nnozzle_diameter = 0.4,0.6\ntemperature = 210\nfirst_layer_speed = 50%\ngcode_flavor = klipper\n"
      "start_gcode = G28\\nM109 S[first_layer_temperature] ; {temperature[0]-10}\n",
      "[printer:*b*]\nbed_shape = 9x0,0x9,-9x0,0x-9\nmax_print_height = 100\ndefault_filament_profile = \"f\";g\n[printer:a]\ninherits = *b*; *b*\n"
      "end_gcode = G1 Z{max_print_height-1}\n[filament:f]\ntemperature = 200\nmin_fan_speed = 10\nfan_always_on = 1\n",
      R"({"type": "machine", "name": "a", "printable_area": ["0x0", "9x0", "9x9", "0x9"], "machine_start_gcode": "G28\nT[initial_tool]"})",
      R"({"type": "filament", "nozzle_temperature": ["200"], "filament_type": ["PLA"], "filament_max_volumetric_speed": ["2"]})"};
}

std::vector<std::string> change_seeds() { return {"fan.from_layer=2; bed.corner_mm=-110,-110", "material.flow=0.85"}; }

constexpr std::string_view kProfileSources =
    "pipeline/job/profiles stages/support/text pipeline/machine stages/program/head_grid";
const Registered kMachine({"machine", read_machine, machine_seeds, kProfileSources, ".toml", "toml.dict", 8192});
const Registered kExtruder({"extruder", read_extruder, extruder_seeds, kProfileSources, ".toml", "toml.dict", 8192});
const Registered kImport({"import", read_import, import_seeds, "pipeline/machine/import stages/support/text", ".ini .json",
                          "slicer.dict", 8192});
const Registered kChanges({"profile_changes", read_changes, change_seeds, kProfileSources, "", "toml.dict", 512});

}  // namespace
}  // namespace lamina::fuzz
