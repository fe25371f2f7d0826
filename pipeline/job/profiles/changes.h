// pipeline/job/profiles/changes.h: changed values for some keys of a profile.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/support/text/toml.h"

namespace lamina::read {

/// Keys with their section, and the value as text: fan.from_layer, 2. Names are not checked.
using ProfileChanges = std::vector<std::pair<std::string, std::string>>;

/// Reads { fan = { from_layer = 2 } }, or fan.from_layer = 2. returns "" or an error message; at  its place
std::string read_changes(const TomlValue& table, ProfileChanges& changes, Place& at);

/// Reads the option form: "fan.from_layer=2; bed.corner_mm=-110,-110". returns "" or an error message
std::string read_changes(std::string_view text, ProfileChanges& changes);

/// "{ fan.from_layer = 2 }", empty if there are none.
std::string changes_text(const ProfileChanges& changes);

}  // namespace lamina::read
