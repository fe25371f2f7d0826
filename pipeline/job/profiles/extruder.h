// pipeline/job/profiles/extruder.h: profiles of extrusion printers as TOML (pipeline/machine/shipped/extruders/*.toml).
#pragma once

#include <string>
#include <string_view>

#include "pipeline/job/profiles/library.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"

namespace lamina::read {

/// Reads a profile; refuses unknown keys. Does not check the tables of its calibration, see segment::check.
/// files    at least one
/// profile  the values of keys absent from them
/// errors   kUsage: place, key, reason; a powder printer's profile
Result<ExtruderProfile> read_extruder(const ProfileFiles& files, ExtruderProfile profile);

/// Sets one key, such as material.flow to 0.85. returns "" or an error message
std::string set_extruder_key(std::string_view name, std::string_view value, ExtruderProfile& profile);

/// The text with every key of a profile; reading it restores the profile.
std::string extruder_text(const ExtruderProfile& profile);

}  // namespace lamina::read
