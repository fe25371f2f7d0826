#include "pipeline/machine/profiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "pipeline/job/decisions.h"
#include "pipeline/job/errors.h"
#include "stages/bead/predicted_tables.h"
#include "stages/geometry/bead_section.h"
#include "stages/program/dialect.h"
#include "stages/program/head_grid.h"
#include "stages/segment/calibration.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/key.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// The files of a profile, shipped or the user's. unknown(suggestion, names)  makes the error for an unknown name
template <class Unknown>
Result<ProfileFiles> find(const std::string& name_or_file, std::span<const ShippedProfile> shipped, const Unknown& unknown) {
  const Library library = profile_library();
  std::vector<std::string_view> names = names_of(shipped);
  if (!is_profile_path(name_or_file) && std::ranges::find(names, name_or_file) == names.end() &&
      !library.is_own(name_or_file)) {
    const std::vector<std::string> own = library.own_names();
    names.insert(names.end(), own.begin(), own.end());
    return Error{Fault::kUsage, unknown(suggest(name_or_file, names), fmt::format("{}", fmt::join(names, ", ")))};
  }
  ProfileFiles files;
  const Status status = library.add(name_or_file, files);
  return status ? Result<ProfileFiles>(std::move(files)) : status.error();
}

bool is_one_of(std::span<const ShippedProfile> shipped, std::string_view name) {
  return std::ranges::find(shipped, name, &ShippedProfile::name) != shipped.end();
}

Result<ExtruderProfile> extruder_of(const ProfileFiles& files) {
  if (have_section(files, "head") && !have_section(files, "material"))
    return Error{Fault::kUsage, files.back().where + ": is the profile of a powder printer; lamina jet takes it"};
  count(Decision::kMachine);
  auto profile = read_extruder(files, {.machine = {}, .calibration = segment::anet_a8_calibration()});
  if (!profile) return profile;
  if (const Status status = segment::check(profile->calibration); !status)
    return usage("{}: calibration.{}", files.back().where, status.error().message);
  return profile;
}

/// Adds the files of a material, which change those of a printer.
/// errors  kUsage, with the known names; sections that are not a material's
Status add_material(const std::string& name_or_file, ProfileFiles& files) {
  const auto found = find(name_or_file, shipped_materials(), [&](const std::string& near, const std::string& names) {
    return fmt::format("no material '{}'{}; name a profile (a file that ends in .toml) or one of {}", one_line(name_or_file),
                       near, names);
  });
  if (!found) return found.error();
  for (const ProfileFile& file : *found) {
    for (const std::string& section : file.keys.name) {
      if (section == "material" || section == "fan") continue;
      return usage("{}: [{}] is no section of a material, which has [material] and [fan]; leave it out", file.where,
                   one_line(section));
    }
    files.push_back(file);
  }
  return {};
}

/// errors  kUsage: one of the temperatures is above those of the machine
Status check_temperatures(const Extruder& machine) {
  const auto& m = machine.material;
  const auto check = [&](std::string_view what, double degc, double maximum, std::string_view key) -> Status {
    if (maximum <= 0 || degc <= maximum) return {};
    return usage("{}{} of {:g} degrees: {} reaches {:g} (machine.{}); choose a material or a temperature below it",
                 m.name.empty() ? "" : m.name + ": ", what, degc, machine.name, maximum, key);
  };
  if (Status status = check("nozzle", std::max(m.nozzle_degc, m.first_nozzle_degc), machine.max_nozzle_degc, "max_nozzle_degc");
      !status)
    return status;
  return check("bed", std::max(m.bed_degc, m.first_bed_degc), machine.max_bed_degc, "max_bed_degc");
}

/// errors  kUsage: one of the profiles is not there, says the job file that names it
Status check_there(const Job& job, const std::vector<std::string>& presets) {
  for (const auto& [path, what] : job.missing) {
    if (path == job.machine.profile || std::ranges::find(presets, path) != presets.end()) return Error{Fault::kUsage, what};
  }
  return {};
}

}  // namespace

Library profile_library() {
  std::vector<ShippedProfile> all;
  for (const auto shipped : {shipped_machines(), shipped_presets(), shipped_extruders(), shipped_materials()})
    all.insert(all.end(), shipped.begin(), shipped.end());
  return {std::move(all), profile_folder()};
}

Result<Machine> read_machine(const ProfileFiles& files) {
  if (have_section(files, "material") && !have_section(files, "head")) {
    const auto other = extruder_of(files);
    return Error{Fault::kUsage, other ? files.back().where + ": is the profile of an extrusion printer; lamina extrude takes it"
                                      : other.error().message};
  }
  count(Decision::kMachine);
  std::vector<std::string_view> dialects;
  for (const auto& dialect : program::dialects()) dialects.push_back(dialect.id);
  return read_machine(files, dialects);
}

Result<Machine> read_machine(std::string_view text, const std::string& where) {
  auto keys = read_toml(text, where);
  return keys ? read_machine(ProfileFiles{{std::move(*keys), where, {}}}) : keys.error();
}

Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where) {
  auto keys = read_toml(text, where);
  return keys ? extruder_of({{std::move(*keys), where, {}}}) : keys.error();
}

Result<ProfileFiles> machine_files(const std::string& name_or_file, const std::vector<std::string>& presets) {
  auto files = find(name_or_file, shipped_machines(), [&](const std::string& near, const std::string& names) {
    if (is_one_of(shipped_extruders(), name_or_file))
      return fmt::format("'{}' is an extrusion printer, of lamina extrude; name a profile or one of {}", name_or_file, names);
    return fmt::format("no machine '{}'; name a profile (a file that ends in .toml) or one of {}{}", name_or_file, names, near);
  });
  for (std::size_t i = 0; files && i < presets.size(); ++i) {
    if (Status status = profile_library().add(presets[i], *files); !status)
      return Error{Fault::kUsage, "--preset: " + status.error().message};
  }
  return files;
}

Result<Machine> find_machine(const std::string& name_or_file, const std::vector<std::string>& presets) {
  const auto files = machine_files(name_or_file, presets);
  return files ? read_machine(*files) : files.error();
}

Result<ExtruderProfile> find_extruder(const std::string& name_or_file, const std::string& material) {
  auto files = find(name_or_file, shipped_extruders(), [&](const std::string& near, const std::string& names) {
    if (is_one_of(shipped_machines(), name_or_file))
      return fmt::format("'{}' is a powder printer, of lamina jet; name a profile or one of {}", name_or_file, names);
    return fmt::format("no extrusion printer '{}'{}; name a profile (a file that ends in .toml) or one of {}",
                       one_line(name_or_file), near, names);
  });
  if (!files) return files.error();
  if (Status status = material.empty() ? Status() : add_material(material, *files); !status)
    return Error{status.error().fault, "--material: " + status.error().message};
  return extruder_of(*files);
}

Result<bool> names_extruder(const std::string& name_or_file) {
  std::vector<ShippedProfile> printers(shipped_extruders().begin(), shipped_extruders().end());
  printers.insert(printers.end(), shipped_machines().begin(), shipped_machines().end());
  const auto files = find(name_or_file, printers, [&](const std::string& near, const std::string& names) {
    return fmt::format("no machine '{}'{}; name a profile (a file that ends in .toml) or one of {}", one_line(name_or_file),
                       near, names);
  });
  if (!files) return files.error();
  return !have_section(*files, "head") || have_section(*files, "material");
}

namespace {

/// Whether the format of a machine's files can express a profile key.
bool has_key_in_file(const Extruder& machine, std::string_view key) {
  if (machine.format != "sml") return !key.starts_with("sml.");
  constexpr std::string_view kOfGcode[] = {"fan.",
                                           "code.",
                                           "retraction.",
                                           "material.nozzle_degc",
                                           "material.bed_degc",
                                           "material.first_nozzle_degc",
                                           "material.first_bed_degc"};
  return std::ranges::none_of(kOfGcode, [&](std::string_view of) { return key.starts_with(of); });
}

}  // namespace

Result<ExtruderProfile> resolve_extruder(const Job& job) {
  if (Status status = check_there(job, {job.extrude.material}); !status) return status.error();
  auto found = find_extruder(job.machine.profile.empty() ? "marlin" : job.machine.profile, job.extrude.material);
  if (!found) {
    const bool of_material = found.error().message.starts_with("--material: ");
    return Error{found.error().fault, (of_material ? "" : "--machine: ") + found.error().message};
  }
  ExtruderProfile& profile = *found;
  for (const auto& [name, value] : job.extrude.machine) {
    if (const std::string wrong = set_extruder_key(name, value, profile); !wrong.empty())
      return usage("extrude.machine: {}", wrong);
    if (!has_key_in_file(profile.machine, name))
      return usage("extrude.machine: {}: is not in {}, which {} reads; leave it out", name,
                   profile.machine.format == "sml" ? "SML" : "G-code", profile.machine.name);
  }
  const ExtrudeRequest& r = job.extrude;
  Extruder& m = profile.machine;
  if (r.flow) m.material.flow = *r.flow;
  if (r.nozzle_degc) m.material.nozzle_degc = m.material.first_nozzle_degc = *r.nozzle_degc;
  if (r.bed_degc) m.material.bed_degc = m.material.first_bed_degc = *r.bed_degc;
  if (r.print_mm_s) m.speed.print_mm_s = *r.print_mm_s;
  if (r.wall_mm_s) m.speed.wall_mm_s = m.speed.inner_wall_mm_s = *r.wall_mm_s;
  if (r.first_layer_mm_s) m.speed.first_layer_mm_s = *r.first_layer_mm_s;
  if (r.travel_mm_s) m.speed.travel_mm_s = *r.travel_mm_s;
  if (r.retraction_mm) m.retraction.length_mm = *r.retraction_mm;
  if (r.fan_percent) m.fan.percent = *r.fan_percent;
  if (r.skirt_loops) m.skirt.loops = *r.skirt_loops;
  if (r.relative_extrusion) m.code.relative_extrusion = *r.relative_extrusion;
  if (Status status = check_temperatures(m); !status) return status.error();
  return found;
}

constexpr std::string_view kPublished = "Anet A8";  // whose widths Di Nisio 2022 measured

constexpr double kMinLag = 1e-3;  // s; what lags less makes no thin stretches

bool has_measured_widths(const ExtruderProfile& profile) {
  return profile.own_calibration || profile.machine.name == kPublished;
}

void predict_calibration(const Job& job, ExtruderProfile& profile) {
  const Extruder& m = profile.machine;
  if (has_measured_widths(profile) || !(m.material.lag_s >= kMinLag)) return;
  const double width = job.fill.all.width_mm, height = job.layer_mm;
  const double area = bead_area(width, height, m.material.shape()) * m.material.flow;
  if (!(area > 0)) return;  // layers that are too thick for such beads are refused elsewhere
  profile.calibration =
      bead::predicted_tables({area, m.material.lag_s, m.speed.acceleration_mm_s2}, width, height, m.speed.print_mm_s);
  profile.predicted_calibration = true;
}

std::optional<Warning> calibration_warning(const ExtruderProfile& profile) {
  const std::string& name = profile.machine.name;
  if (profile.predicted_calibration)
    return Warning{"calibration",
                   fmt::format("{} has no calibration of its own; widths are predicted from the lag of its melt, {:g} s: "
                               "lamina calibrate measures them",
                               name, profile.machine.material.lag_s)};
  if (has_measured_widths(profile)) return std::nullopt;
  return Warning{"calibration", fmt::format("{} has no calibration of its own; widths and limits are those measured on an Anet "
                                            "A8: lamina calibrate makes one",
                                            name)};
}

bool is_named(const Job& job, std::string_view key) { return std::ranges::find(job.named, key) != job.named.end(); }

namespace {

/// Whether the job says how lines are spaced, or that there are none.
bool names_filling(const Job& job) {
  constexpr std::string_view kKeys[] = {"fill.pattern",     "fill.gap_mm",  "fill.distance_mm", "fill.gap_by_height",
                                        "fill.gap_formula", "segment.fill", "fill.group"};
  return job.segment.any() || std::ranges::any_of(kKeys, [&](std::string_view key) { return is_named(job, key); }) ||
         std::ranges::any_of(job.parts, [](const PartRequest& part) { return names_spacing(part.fill); }) ||
         std::ranges::any_of(job.fill.ranges, [](const FillRange& range) { return names_spacing(range.changes); });
}

}  // namespace

void complete_filling(Job& job) {
  FillSettings& fill = job.fill.all;
  if (!fill.density_percent && (needs_density(fill.pattern) || !names_filling(job))) fill.density_percent = 20;
  if (fill.density_percent && fill.pattern == infill::Pattern::kNone && !is_named(job, "fill.pattern")) {
    fill.pattern = infill::Pattern::kGrid;
  }
  if (fill.density_percent && !is_named(job, "fill.seam")) fill.seam = infill::Seam::kAligned;
  if (!is_named(job, "fill.walls")) fill.walls = fill.density_percent ? 2 : 1;
}

void leave_to_machine(const Extruder& machine, Job& job) {
  complete_filling(job);
  if (is_named(job, "layers.thickness_mm") || !job.heights.thickness_mm.empty()) return;
  const bool listed = machine.format == "sml" && !machine.sml.pd.empty();
  job.layer_mm = listed ? machine.sml.pd.front().thickness_mm : machine.material.nozzle_mm / 2;
}

namespace {

Error wrong(const std::string& key, const std::string& what) { return usage("{}: {}", key, what); }

}  // namespace

Result<ResolvedMachine> resolve_profile(const Machine& machine) {
  auto grid = program::make_head_grid(machine);
  if (!grid) return grid.error();
  const program::Dialect* dialect = program::find_dialect(machine.dialect);
  if (dialect == nullptr) return wrong("machine.dialect", fmt::format("there is no dialect '{}'", machine.dialect));
  if (Status status = program::check_dialect(*dialect, machine, *grid); !status) return status.error();
  grid->bit_order = dialect->bit_order;
  if (!machine.powder.materials.empty() && machine.powder.materials.size() != machine.powder.vats) {
    return wrong("powder.materials", fmt::format("{} names for {} vats of {}; name what is in each",
                                                 machine.powder.materials.size(), machine.powder.vats, machine.name));
  }
  return ResolvedMachine{machine, std::move(*grid)};
}

Result<PowderPrinter> resolve_powder_printer(const Job& job) {
  const MachineRequest& request = job.machine;
  PowderPrinter printer;
  if (request.profile.empty()) {
    if (request.scan_speed_mm_s || request.blocked || request.vat_rule || !request.presets.empty())
      return wrong("machine.profile", "is missing; name one with --machine");
    printer.bed = bare_bed(job);
    const auto dpi = job.dpi.value_or(kBareDpi);
    printer.grid = {PixelAxis(pitch_of_dpi(dpi[0]), nm_of(printer.bed.size_mm[0])),
                    PixelAxis(pitch_of_dpi(dpi[1]), nm_of(printer.bed.size_mm[1]))};
    return printer;
  }
  if (const Status status = check_there(job, request.presets); !status) return status.error();
  Result<Machine> found = find_machine(request.profile, request.presets);
  if (!found) return found.error();
  Machine& machine = *found;
  if (request.scan_speed_mm_s) machine.motion.scan_speed_mm_s = *request.scan_speed_mm_s;
  if (request.vat_rule) machine.powder.vat_rule = *request.vat_rule;
  if (request.blocked) machine.head.blocked = *request.blocked;
  if (job.margin_mm) machine.bed.margin_mm = *job.margin_mm;
  auto resolved = resolve_profile(machine);
  if (!resolved) return resolved.error();
  if (job.dpi) {
    if (Status status = program::require_dpi(machine, resolved->grid, *job.dpi); !status) return status.error();
    resolved = resolve_profile(machine);
    if (!resolved) return resolved.error();
  }
  printer.bed = {machine.bed.size_mm, true, machine.bed.margin_mm};
  if (job.bed_mm && *job.bed_mm != machine.bed.size_mm) {
    return wrong("bed.size_mm", fmt::format("the bed of {} is {:g} x {:g} mm; leave it out or change the profile", machine.name,
                                            machine.bed.size_mm[0], machine.bed.size_mm[1]));
  }
  printer.grid = resolved->grid.image;
  printer.machine = std::move(*resolved);
  return printer;
}

}  // namespace lamina::pipeline
