// pipeline/manifest/inspection_file.h: the findings of --inspect, next to the manifest of their job.
//
// The manifest is the same for all runs of a job, inspected or not, so findings have their own file:
//   {"lamina": version, "kind": "inspection", "job": id of the manifest, "inspection": {...}, "warnings": [...]}
#pragma once

#include <optional>
#include <string>

#include "pipeline/manifest/manifest.h"
#include "stages/data/status.h"
#include "stages/support/text/json_value.h"

namespace lamina {

/// DIR/inspection.json.
std::string inspection_path(const std::string& directory);

/// errors  kUsage: a file of that name is not lamina's own
Status check_inspection_file(const std::string& directory);

/// The text of the file. facts  an object whose keys follow those of the job
std::string inspection_text(const ManifestHead& head, const Json& facts);

/// facts  an object whose keys follow those of the job. errors  kUsage, kOutput
Status write_inspection(const std::string& directory, const ManifestHead& head, const Json& facts);

/// Removes a file that is lamina's own and of another job. errors  kOutput
Status keep_inspection_of(const std::string& directory, const ManifestHead& head);

/// What was found in this job; none without a file of it, or with one that says something else.
std::optional<Json> read_inspection(const std::string& directory, const ManifestHead& head);

}  // namespace lamina
