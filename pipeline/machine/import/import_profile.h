// pipeline/machine/import/import_profile.h: a profile of an extrusion printer, or a material, from files of other slicers.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/machine/import/prusa_config.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// First line of every imported profile.
inline constexpr std::string_view kImportMark = "# Imported by lamina";

struct ImportRequest {
  BundleChoice choice;
  bool plain_code = false;  // code of lamina in place of what cannot be translated
};

struct ImportedProfile {
  std::string text;                 // TOML
  std::vector<std::string> notes;   // one line each
  std::vector<std::string> unused;  // keys of the file without effect on the profile
};

/// Converts a configuration or bundle of PrusaSlicer, or a preset of Orca or BambuStudio (a JSON object). Files without a bed
/// become a material.
/// path    of the file: bases of presets are next to it; named in messages
/// errors  kUsage, kInput: those of the readers and of translate_code; a firmware that lamina does not write; a value beyond
///         lamina's limits; neither bed nor temperatures
Result<ImportedProfile> import_profile(std::string_view text, const std::string& path, const ImportRequest& request);

/// The same of a file. errors  kUsage: missing, no file, or above 16 MiB
Result<ImportedProfile> import_profile(const std::string& path, const ImportRequest& request);

}  // namespace lamina::pipeline
