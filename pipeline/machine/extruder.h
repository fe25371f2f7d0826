// pipeline/machine/extruder.h: extrusion printers as TOML, shipped with the program or from a file.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "pipeline/job/job.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"
#include "stages/segment/calibration.h"

namespace lamina::pipeline {

/// A profile that is part of the program (stages/write/machines/extrusion/*.toml).
struct ShippedExtruder {
  std::string_view name, text;
};
std::span<const ShippedExtruder> shipped_extruders();

/// A printer and what was measured on it.
struct ExtruderProfile {
  Extruder machine;
  segment::Calibration calibration = segment::anet_a8_calibration();
  bool own_calibration = false;  // the profile has one; otherwise it is the published one of the Anet A8
};

/// Reads a profile. `where` names it in messages. Every key has a default; unknown ones are refused.
/// errors  kUsage: place, key, what is wrong
Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where);

/// The profile of that name, or in that file (anything with a slash or that ends in .toml).
/// errors  kUsage, with the shipped names
Result<ExtruderProfile> find_extruder(const std::string& name_or_file);

/// Changes one key, as in material.flow to 0.85. returns "" or what is wrong
std::string set_extruder_key(std::string_view name, std::string_view value, ExtruderProfile& profile);

/// Every key of a profile; reading it back gives the same profile.
std::string extruder_text(const ExtruderProfile& profile);

/// The printer of a job: found, with the job's changes. The job stays as it is.
/// errors  kUsage
Result<ExtruderProfile> resolve_extruder(const Job& job);

}  // namespace lamina::pipeline
