#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/cli/made_profiles.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/output/print_program.h"
#include "pipeline/report/machine_text.h"
#include "stages/program/bed.h"
#include "stages/program/dialect.h"
#include "stages/support/io/file.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec machines_spec() {
  CommandSpec spec;
  spec.summary =
      "Lists the powder printers of lamina jet and the extrusion printers of lamina extrude. Explains what follows from a\n"
      "profile: dpi across and along the scan, nozzle lag, swaths, top speed, time and bytes per layer.";
  spec.operand = "NAME|FILE";
  spec.operand_meaning = "machines to explain, as with --check";
  spec.operand_words = names_of(shipped_machines());
  for (const std::string_view name : names_of(shipped_extruders())) spec.operand_words.push_back(name);
  const auto& names = spec.operand_words;
  spec.options = {
      {"--check", "NAME|FILE", "machine to explain: a name, or a profile in TOML", "", "", names},
      {"--show", "NAME|FILE", "machine whose complete profile is printed, as a template", "", "", names},
      {"--preset", "NAME|FILE", "powder, binder and process preset; repeatable", "", "", names_of(shipped_presets())},
      {"--dialects", "", "list the dialects of print programs", "", ""},
      {"--target", "STL", "write a test part that shows the directions of x, y and z", "", ""},
      {"--import", "FILE", "profile of PrusaSlicer (.ini), Orca or BambuStudio (.json)", "", ""},
      {"--printer", "NAME", "printer of a PrusaSlicer bundle to import", "", ""},
      {"--filament", "NAME", "filament to import; default: the printer's", "", ""},
      {"--plain-code", "", "replace code with conditions by lamina's", "", ""},
      {"--new", "", "write a profile from answers on standard input", "", ""},
      {"-o,--output", "FILE", "imported or new profile; default: standard output", "", ""},
      {"--overwrite", "", "replace a file that lamina did not write", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina machines\n"
      "  lamina machines --check nuferbj\n"
      "  lamina machines --show nuferbj > mine.toml\n"
      "  lamina machines --show jet1000 --preset example-steel       each value with the file that it comes from\n"
      "  lamina jet part.stl --machine mine.toml -o out\n"
      "  lamina machines --import bundle.ini --printer MINI -o mini.toml";
  return spec;
}

std::string explain(const ExtruderProfile& profile) {
  const Extruder& m = profile.machine;
  return fmt::format(
      "machine   {}: {}\nbed       {:g} x {:g} mm, {:g} mm high\nnozzle    {:g} mm, filament {:g} mm\nfile      {}\n"
      "widths    {}\n",
      m.name, m.description, m.bed.size_mm[0], m.bed.size_mm[1], m.bed.build_height_mm, m.material.nozzle_mm,
      m.material.filament_mm, m.format == "sml" ? "SML; its path words are our own, no public reader knows them" : "G-code",
      profile.own_calibration ? "measured on it"
      : has_measured_widths(profile) || !(m.material.lag_s > 0)
          ? "as published for an Anet A8; lamina calibrate measures them"
          : "predicted from the lag of its melt; lamina calibrate measures them");
}

/// A profile whose layer 1 has the care that is due in some layers, and the share of layers that are such.
struct MaintenanceCase {
  Machine machine;
  double share = 1;
};

/// Shots and wipes are due every so many layers, apart or in the same one: up to four kinds of layers.
std::vector<MaintenanceCase> maintenance_cases(const Machine& machine) {
  constexpr std::uint32_t kNever = 1'000'000;  // a layer later than 1
  const auto& maintenance = machine.maintenance;
  const double shots = maintenance.spit_layers, wipes = maintenance.wipe_layers;
  const double both =
      shots > 0 && wipes > 0
          ? 1.0 / static_cast<double>(std::lcm(std::uint64_t{maintenance.spit_layers}, std::uint64_t{maintenance.wipe_layers}))
          : 0;
  const double shot = shots > 0 ? 1 / shots : 0, wipe = wipes > 0 ? 1 / wipes : 0;
  std::vector<MaintenanceCase> cases;
  const auto add = [&](bool shoots, bool wipes_too, double share) {
    if (share < 1e-12) return;
    MaintenanceCase& made = cases.emplace_back(MaintenanceCase{machine, share});
    if (shots > 0) made.machine.maintenance.spit_layers = shoots ? 1 : kNever;
    if (wipes > 0) made.machine.maintenance.wipe_layers = wipes_too ? 1 : kNever;
  };
  add(false, false, 1 - shot - wipe + both);
  add(true, false, shot - both);
  add(false, true, wipe - both);
  add(true, true, both);
  return cases;
}

/// Compiles and times a full layer and an empty one, averaged over the kinds of layers that care makes; none if the vectors of
/// the full one take more than 256 MiB, six times those of the largest shipped machine, or its program more than 1 GiB.
Result<std::optional<program::FullLayer>> time_full_layer(const ResolvedMachine& resolved) {
  const HeadGrid& grid = resolved.grid;
  const PrintProgram program(resolved, "", 1, {});
  const double vectors =
      double(grid.swaths(0)) * grid.passes * static_cast<double>(grid.steps()) * grid.words() * 8 * grid.drop_bits;
  if (vectors > (256 << 20) || program.bytes_bound(2 * std::uint64_t{grid.image.rows()}, grid.head_drops) > (1u << 30)) {
    return std::optional<program::FullLayer>();
  }
  program::FullLayer full;
  full.thickness_mm = std::max(0.1, resolved.machine.motion.layer_step_um / 1000);
  const auto thickness = static_cast<Nm>(nm_of(full.thickness_mm));
  const Layer layer{1, thickness, thickness};  // the first one has the base of powder below it
  const Runs image = program::image_of_bed(resolved.machine, grid.image);
  Runs empty = image;
  empty.change.clear();
  std::fill(empty.row_offset.begin(), empty.row_offset.end(), 0u);
  const auto timed = [&](const Machine& machine, const Runs& of, std::uint32_t drops) -> Result<ProgramRecord> {
    const ResolvedMachine changed{machine, grid};
    const PrintProgram written(changed, "", 1, {});
    ProgramWork work;
    ProgramRecord record;
    Levels zones;
    levels_of(of, 1, zones);
    DropPatterns patterns;
    patterns.zone = {{}, {static_cast<std::uint8_t>(drops)}};
    const Status status = drops == 1
                              ? written.write_layer(layer, of, {0}, work, record)
                              : written.write_layer(layer, PrintProgram::Drops{{zones, &patterns}, drops}, {0}, work, record);
    return status ? Result<ProgramRecord>(record) : Result<ProgramRecord>(status.error());
  };
  for (const MaintenanceCase& one : maintenance_cases(resolved.machine)) {
    const auto filled = timed(one.machine, image, 1), none = timed(one.machine, empty, 1);
    if (!filled || !none) return filled ? none.error() : filled.error();
    full.sweeps = filled->sweeps;
    full.seconds += one.share * static_cast<double>(filled->microseconds) / 1e6;
    full.empty_seconds += one.share * static_cast<double>(none->microseconds) / 1e6;
    full.spat_drops += one.share * static_cast<double>(filled->spat);
    if (grid.head_drops == 1) continue;
    const auto all = timed(one.machine, image, grid.head_drops);
    if (!all) return all.error();
    full.drops_seconds += one.share * static_cast<double>(all->microseconds) / 1e6;
  }
  if (resolved.machine.maintenance.spits() || resolved.machine.maintenance.wipes()) {
    Machine without = resolved.machine;
    without.maintenance = {};
    const auto filled = timed(without, image, 1);
    if (!filled) return filled.error();
    full.maintenance_seconds = full.seconds - static_cast<double>(filled->microseconds) / 1e6;
  }
  return std::optional(full);
}

/// A printer by name or file, first among powder printers, then extrusion: its profile or its derived values.
/// errors  for an unknown name, those of powder printers
Result<std::string> printer_text(const std::string& name, const std::vector<std::string>& presets, bool whole) {
  for (const ShippedProfile& material : shipped_materials()) {
    if (material.name == name) return std::string(material.text);
  }
  const auto files = machine_files(name, presets);
  const Result<Machine> powder = files ? read_machine(*files) : files.error();
  if (!powder) {
    const auto extrusion = find_extruder(name);
    if (!extrusion) return powder.error();
    return whole ? extruder_text(*extrusion) : explain(*extrusion);
  }
  if (whole) return sourced_text(machine_text(*powder), *files);
  const auto resolved = resolve_profile(*powder);
  if (!resolved) return resolved.error();
  const auto full = time_full_layer(*resolved);
  if (!full) return full.error();
  return program::explain(resolved->machine, resolved->grid, *full);
}

Outcome run_machines(const Arguments& arguments, Context& context) {
  if (arguments.has("--import") || arguments.has("--new")) return make_profile(arguments, context);
  for (const char* flag : {"--printer", "--filament", "--plain-code", "-o,--output"}) {
    if (arguments.has(flag)) return at_option(flag, "applies to --import; add it");
  }
  const bool explains = arguments.has("--check") || arguments.has("--show") || !arguments.operands.empty();
  if (arguments.has("--preset") && !explains) return at_option("--preset", "applies to --check and --show; add one of them");
  if (arguments.has("--target") && (explains || arguments.has("--dialects")))
    return at_option("--target", "is written alone; leave out --check, --show, --dialects and the names of machines");
  if (arguments.has("--target")) {
    const auto part = program::orientation_target();
    if (Status status = write_file(arguments.text("--target"), part); !status) return status.error();
    context.say(
        fmt::format("{}: an F of 20 x 30 mm: its stem lies along +y, its arms point to +x, a step of 1 mm on top lies at its "
                    "foot; read mirrored or turned, so is the machine",
                    arguments.text("--target")));
    return 0;
  }
  std::string text;
  std::vector<std::string> presets;
  if (Status status = arguments.read("--preset", read_presets, presets); !status) return status;
  if (arguments.has("--dialects")) {
    for (const program::Dialect& dialect : program::dialects())
      text += fmt::format("{:<12}{}\n", dialect.id, dialect.description);
  }
  for (const std::string& name : arguments.all("--show")) {
    const auto profile = printer_text(name, presets, true);
    if (!profile) return profile.error();
    text += *profile;
  }
  std::vector<std::string> checked = arguments.all("--check");
  checked.insert(checked.end(), arguments.operands.begin(), arguments.operands.end());
  for (const std::string& name : checked) {
    const auto explained = printer_text(name, presets, false);
    if (!explained) return explained.error();
    text += (text.empty() ? "" : "\n") + *explained;
  }
  if (text.empty()) {
    for (const ShippedProfile& shipped : shipped_machines()) {
      const Result<Machine> machine = read_machine(shipped.text, std::string(shipped.name));
      if (!machine) return machine.error();
      text += fmt::format("{:<16}{}\n", shipped.name, machine->description);
    }
    text += "\n--preset:\n";
    for (const ShippedProfile& shipped : shipped_presets()) text += fmt::format("{}\n", shipped.name);
    const Library library = profile_library();
    if (!library.own_names().empty()) text += fmt::format("\nin {}:\n", one_line(library.folder()));
    for (const std::string& name : library.own_names()) text += one_line(name) + "\n";
    text += "\nlamina extrude:\n";
    for (const ShippedProfile& shipped : shipped_extruders()) {
      const auto profile = find_extruder(std::string(shipped.name));
      if (!profile) return profile.error();
      text += fmt::format("{:<16}{}\n", shipped.name, profile->machine.description);
    }
    text += "\nlamina extrude --material:\n";
    for (const ShippedProfile& shipped : shipped_materials()) text += fmt::format("{}\n", shipped.name);
  }
  return context.print(text);
}

}  // namespace

const Command machines_command = {"machines", "list printers; show and check machine profiles", machines_spec, run_machines};

}  // namespace lamina::pipeline
