// pipeline/job/profiles/extruder.h: profiles of extrusion printers as TOML (pipeline/machine/shipped/extruders/*.toml).
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/job/profiles/library.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"
#include "stages/support/text/toml.h"

namespace lamina::pipeline {

/// Reads a profile; refuses unknown keys. Does not check the tables of its calibration, see segment::check.
/// files    at least one
/// profile  the values of keys absent from them
/// errors   kUsage: place, key, reason; a powder printer's profile
Result<ExtruderProfile> read_extruder(const ProfileFiles& files, ExtruderProfile profile);

/// Sets one key, such as material.flow to 0.85. returns "" or an error message
std::string set_extruder_key(std::string_view name, std::string_view value, ExtruderProfile& profile);

/// The text with every key of a profile; reading it restores the profile.
std::string extruder_text(const ExtruderProfile& profile);
/// Only the keys of its material, of those in `keys` as section.key: of [material] without nozzle, flow and lag, and of [fan].
std::string material_text(const ExtruderProfile& profile, const std::vector<std::string>& keys);

// --- changed values for some keys of a profile.

/// Keys with their section, and the value as text: fan.from_layer, 2. Names are not checked.
using ProfileChanges = std::vector<std::pair<std::string, std::string>>;

/// Reads { fan = { from_layer = 2 } }, or fan.from_layer = 2. returns "" or an error message; at  its place
std::string read_changes(const TomlValue& table, ProfileChanges& changes, TextPosition& at);

/// Reads the option form: "fan.from_layer=2; bed.corner_mm=-110,-110". returns "" or an error message
std::string read_changes(std::string_view text, ProfileChanges& changes);

/// "{ fan.from_layer = 2 }", empty if there are none.
std::string changes_text(const ProfileChanges& changes);

}  // namespace lamina::pipeline
