// pipeline/machine/profiles.h: machine profiles by name or file: those shipped with the program, and people's own.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "stages/data/extruder.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"
#include "stages/read/profiles/extruder.h"
#include "stages/read/profiles/printer.h"

namespace lamina::pipeline {

/// A profile that is part of the program.
struct ShippedProfile {
  std::string_view name, text;
};
std::span<const ShippedProfile> shipped_machines();   // powder printers, stages/write/machines/*.toml
std::span<const ShippedProfile> shipped_extruders();  // stages/write/machines/extrusion/*.toml

/// Reads a profile. `where` names it in messages.
/// errors  kUsage: place, key, what is wrong; an unknown dialect
Result<Machine> read_machine(std::string_view text, const std::string& where);

/// The same of an extrusion printer; without a calibration of its own it has the published one of the Anet A8.
/// errors  kUsage: place, key, what is wrong; those of segment::check
Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where);

/// The profile of that name, or in that file (anything with a slash or that ends in .toml).
/// errors  kUsage, with the shipped names
Result<Machine> find_machine(const std::string& name_or_file);
Result<ExtruderProfile> find_extruder(const std::string& name_or_file);

}  // namespace lamina::pipeline
