// stages/write/manifest/kept.h: what an interrupted job of contours or toolpaths has on record, and still holds.
#pragma once

#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/write/manifest/manifest.h"

namespace lamina {

/// Refuses records of another job, or of other layers. path  of the manifest, for the error. errors  kUsage
Status check_same_job(const std::string& path, const Manifest& manifest, const ManifestHead& head);

/// The records, from the first on, whose bytes are in one file; none if it does not begin with `start`.
/// cost  reads the file once
std::vector<LayerRecord> records_that_hold(const std::string& file, const std::vector<LayerRecord>& recorded,
                                           std::string_view start);

/// The records, from the first on, whose files 000000.ext and up are in a folder, with the size and hash on record. Links are
/// no files of a job. cost  reads every file once
std::vector<LayerRecord> records_with_files(const std::string& folder, const Manifest& manifest);

}  // namespace lamina
