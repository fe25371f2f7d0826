// pipeline/job/lists/old_forms.h: deprecated string forms of job files, accepted for one version with a note.
#pragma once

#include <string>
#include <vector>

#include "stages/support/text/toml.h"

namespace lamina::read {

/// Replaces old forms in a job's tree by equivalent tables: fill.by_height, segment.by_height,
/// part.material_by_height, part.fill, fill.gap_by_height and extrude.set as strings. notes  gets a line for each
/// file  the job file or option named in the notes
/// errors  kUsage: a string that does not match the old form
Status replace_old_forms(TomlValue& job, const std::string& file, std::vector<std::string>& notes);

}  // namespace lamina::read
