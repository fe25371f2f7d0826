// pipeline/machine/import/prusa_config.h: PrusaSlicer's files of settings: an exported configuration, "key = value" a line, and
// bundles, which have sections that inherit.
//
//      [printer:*common*]                            a name between asterisks is a base alone
//      [printer:MINI]
//      inherits = *common*; *short*                  of what several have, the last one counts
//      default_filament_profile = "Prusament PLA"
#pragma once

#include <string>
#include <string_view>

#include "pipeline/machine/import/slicer_settings.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Which sections of a bundle are a printer.
struct BundleChoice {
  std::string printer;
  std::string filament;  // empty: the printer's default
};

struct PrusaConfig {
  std::string name;  // of the printer; "" if the file does not have it
  SlicerSettings settings;
  std::vector<std::string> notes;  // what is absent, one line each
};

/// Reads either kind. Values of code are without their escapes.
/// where   names the file in messages
/// errors  kUsage: a printer that is missing or wrong, with the known names; sections that inherit in a circle, from unknown
///         ones, or too much; --printer of a file without sections. kInput: a line that is no setting
Result<PrusaConfig> read_prusa_config(std::string_view text, const std::string& where, const BundleChoice& choice);

}  // namespace lamina::pipeline
