// stages/read/profiles/extruder.h: profiles of extrusion printers as TOML (stages/write/machines/extrusion/*.toml).
#pragma once

#include <string>
#include <string_view>

#include "stages/data/extruder.h"
#include "stages/data/status.h"

namespace lamina::read {

/// Reads a profile; unknown keys are refused. The tables of its calibration are not checked, see segment::check.
/// where    names it in messages
/// profile  the values of keys that the text does not give
/// errors   kUsage: place, key, what is wrong; a powder printer's profile
Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where, ExtruderProfile profile);

/// Changes one key, as in material.flow to 0.85. returns "" or what is wrong
std::string set_extruder_key(std::string_view name, std::string_view value, ExtruderProfile& profile);

/// Every key of a profile; reading it back gives the same profile.
std::string extruder_text(const ExtruderProfile& profile);

}  // namespace lamina::read
