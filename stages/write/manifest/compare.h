// stages/write/manifest/compare.h: is what a job left behind what its manifest says.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "stages/data/hash.h"
#include "stages/data/status.h"
#include "stages/write/manifest/manifest.h"

namespace lamina {

/// "", or "NAME: is missing" and whatever else a file of the directory differs from its record in.
/// cost  reads the file once
std::string fault_of_file(const std::string& directory, const std::string& name, const Hash128& hash,
                          std::optional<std::uint64_t> bytes = {});

/// Compares contours or toolpaths with their manifest: the bytes of each layer, in the one file or in files of their own,
/// have the recorded hash; layers follow each other without a gap; so does the file as a whole; no other layers lie in
/// layers/.
///
/// directory  of the one file, or of layers/
/// returns    bytes of the files
/// cost       reads every file once, the one file of all layers twice
std::uint64_t compare_paths(const std::string& directory, const Manifest& manifest, Faults& faults);

}  // namespace lamina
