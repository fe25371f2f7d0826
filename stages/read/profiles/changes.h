// stages/read/profiles/changes.h: other values for some keys of a profile.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/text/toml.h"

namespace lamina::read {

/// Keys with their section, and the value as text: fan.from_layer, 2. Names are not checked.
using ProfileChanges = std::vector<std::pair<std::string, std::string>>;

/// Reads { fan = { from_layer = 2 } }, or fan.from_layer = 2. returns "" or what is wrong; at  where
std::string read_changes(const TomlValue& table, ProfileChanges& changes, Place& at);

/// Reads the same as an option: "fan.from_layer=2; bed.corner_mm=-110,-110". returns "" or what is wrong
std::string read_changes(std::string_view text, ProfileChanges& changes);

/// "{ fan.from_layer = 2 }", empty if there are none.
std::string changes_text(const ProfileChanges& changes);

}  // namespace lamina::read
