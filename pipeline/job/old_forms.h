// pipeline/job/old_forms.h: what job files said in strings before TOML said it: read for one version, with a note.
#pragma once

#include <string>
#include <vector>

#include "stages/text/toml.h"

namespace lamina::pipeline {

/// Replaces the old forms of a job's tree by the tables that say the same: fill.by_height, segment.by_height,
/// part.material_by_height, part.fill, fill.gap_by_height and extrude.set as strings. notes  gets a line for each
/// file  names the job file in them, or the option
/// errors  kUsage: a string that is none of the old form
Status replace_old_forms(TomlValue& job, const std::string& file, std::vector<std::string>& notes);

}  // namespace lamina::pipeline
