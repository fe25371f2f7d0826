// pipeline/machine/import/orca_config.h: presets of OrcaSlicer and BambuStudio, one JSON object a file, with `inherits`.
#pragma once

#include <string>
#include <string_view>

#include "pipeline/machine/import/prusa_config.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Reads a preset of a machine or a filament, what it inherits, and a machine's default filament and process. Bases are files
/// NAME.json in the preset's folder and those below; if one of its folders is called machine, filament or process, in
/// the folder of that one and those below. Filaments of Orca's own library are in OrcaFilamentLibrary next to it.
/// path      of the file, for its folder and for messages
/// filament  of a machine, instead of its default
/// errors  kUsage: a preset of another kind, an unknown base, a circle, more than 32 files deep, a folder with too many files.
///         kInput: no JSON
Result<PrusaConfig> read_orca_config(std::string_view text, const std::string& path, const std::string& filament = {});

}  // namespace lamina::pipeline
