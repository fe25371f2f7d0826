// pipeline/machine/profiles.h: machine profiles by name or file, shipped or user-defined.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/job/profiles/extruder.h"
#include "pipeline/job/profiles/library.h"
#include "pipeline/job/profiles/printer.h"
#include "stages/data/extruder.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/status.h"
#include "stages/support/text/value.h"

namespace lamina::pipeline {

std::span<const ShippedProfile> shipped_machines();   // powder printers, pipeline/machine/shipped/printers/*.toml
std::span<const ShippedProfile> shipped_presets();    // powder, binder and process for them, presets/*.toml there
std::span<const ShippedProfile> shipped_extruders();  // pipeline/machine/shipped/extruders/*.toml
std::span<const ShippedProfile> shipped_materials();  // filaments for them, pipeline/machine/shipped/materials/*.toml

/// All of them, and the user's own.
Library profile_library();

/// Reads a profile that inherits nothing. `where` names it in messages.
/// errors  kUsage: place, key, reason; an unknown dialect
Result<Machine> read_machine(std::string_view text, const std::string& where);
Result<Machine> read_machine(const ProfileFiles& files);

/// The same for an extrusion printer; the default calibration is the published one of the Anet A8.
/// errors  kUsage: place, key, reason; those of segment::check
Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where);

/// The files of a powder printer's profile by name or file, and those of presets, which change it in their order.
/// errors  kUsage, with the known names; of Library
Result<ProfileFiles> machine_files(const std::string& name_or_file, const std::vector<std::string>& presets = {});

/// The profile with that name, or in that file (a text with a slash or ending in .toml).
/// errors  kUsage, with the known names
Result<Machine> find_machine(const std::string& name_or_file, const std::vector<std::string>& presets = {});
/// material  that changes an extrusion printer, by name or file; empty: the printer's
/// errors    kUsage: an unknown material, or keys that are not a material's
Result<ExtruderProfile> find_extruder(const std::string& name_or_file, const std::string& material = {});

/// Whether it is the profile of an extrusion printer, else of a powder printer; a file may be wrong in other ways.
/// errors  kUsage: neither, with the shipped names
Result<bool> names_extruder(const std::string& name_or_file);

// --- the extrusion printer of a job.

/// Finds the job's printer (default: marlin) and applies the job's material and changes to it.
/// errors  kUsage; temperatures above those that the printer reaches
Result<ExtruderProfile> resolve_extruder(const Job& job);

/// Whether widths of segmented lines were measured on this printer, or on the one that the documents had.
bool has_measured_widths(const ExtruderProfile& profile);
/// Where none were and the melt's lag is known, the tables of the calibration are those that the model of a bead has for beads
/// and layers of the job (stages/bead/predicted_tables.h), in place of those of another machine.
void predict_calibration(const Job& job, ExtruderProfile& profile);

/// Whose widths segmented lines have, if none were measured on this printer. profile  of predict_calibration()
std::optional<Warning> calibration_warning(const ExtruderProfile& profile);

/// Whether a file, an option or --set gave the key, as in "fill.walls".
bool is_named(const Job& job, std::string_view key);

/// Completes the filling of an extrusion job: two walls and a grid of 20 % where the job names no pattern, no distances and no
/// segmented lines; one wall where it does. A density without a pattern is one of a grid.
void complete_filling(Job& job);

/// Replaces the defaults of powder jobs by the printer's where values are unset: complete_filling(), layers of half of the nozzle.
void leave_to_machine(const Extruder& machine, Job& job);

// --- finds, changes and checks the powder printer of a job.

/// The bed under the parts.
struct Bed {
  std::array<double, 2> size_mm = kBareBedMm;
  bool of_machine = false;  // fixed by the machine
  double margin_mm = 0;     // where nothing is arranged
};

/// For parts without a printer.
inline constexpr Bed kLargestBed{{kMaxMm, kMaxMm}};
/// The bed of a job without a machine.
inline Bed bare_bed(const Job& job) { return {job.bed_mm.value_or(kBareBedMm), false, job.margin_mm.value_or(0)}; }

/// A profile with the job's changes, and the resulting grid.
struct ResolvedMachine {
  Machine machine;
  HeadGrid grid;
};

/// A profile and its grid, with the dialect checked. errors  of make_head_grid and check_dialect
Result<ResolvedMachine> resolve_profile(const Machine& machine);

/// The target of a job's images: its machine, or a bare bed.
struct PowderPrinter {
  std::optional<ResolvedMachine> machine;  // absent without a machine
  Bed bed;
  PixelGrid grid;  // of the images
};

/// Finds the machine of a job; without one, bed and dpi are the job's. A given bed.dpi configures the head: the number of
/// interlaced passes across the scan, and the pixel length along it.
/// errors  kUsage: no such machine, a dpi that the head cannot reach, a bed that differs from the machine's
Result<PowderPrinter> resolve_powder_printer(const Job& job);

}  // namespace lamina::pipeline
