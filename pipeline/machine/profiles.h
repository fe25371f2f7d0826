// pipeline/machine/profiles.h: machine profiles by name or file, shipped or user-defined.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/profiles/extruder.h"
#include "pipeline/job/profiles/library.h"
#include "pipeline/job/profiles/printer.h"
#include "stages/data/extruder.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

using read::names_of;
using read::ShippedProfile;
std::span<const ShippedProfile> shipped_machines();   // powder printers, pipeline/machine/shipped/printers/*.toml
std::span<const ShippedProfile> shipped_presets();    // powder, binder and process for them, presets/*.toml there
std::span<const ShippedProfile> shipped_extruders();  // pipeline/machine/shipped/extruders/*.toml

/// All of them, and the user's own.
read::Library profile_library();

/// Reads a profile that inherits nothing. `where` names it in messages.
/// errors  kUsage: place, key, reason; an unknown dialect
Result<Machine> read_machine(std::string_view text, const std::string& where);
Result<Machine> read_machine(const read::ProfileFiles& files);

/// The same for an extrusion printer; the default calibration is the published one of the Anet A8.
/// errors  kUsage: place, key, reason; those of segment::check
Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where);

/// The files of a powder printer's profile by name or file, and those of presets, which change it in their order.
/// errors  kUsage, with the known names; of read::Library
Result<read::ProfileFiles> machine_files(const std::string& name_or_file, const std::vector<std::string>& presets = {});

/// The profile with that name, or in that file (a text with a slash or ending in .toml).
/// errors  kUsage, with the known names
Result<Machine> find_machine(const std::string& name_or_file, const std::vector<std::string>& presets = {});
Result<ExtruderProfile> find_extruder(const std::string& name_or_file);

/// Whether it is the profile of an extrusion printer, else of a powder printer; a file may be wrong in other ways.
/// errors  kUsage: neither, with the shipped names
Result<bool> names_extruder(const std::string& name_or_file);

}  // namespace lamina::pipeline
