// pipeline/report/part_info.h: the description of a part file before it is planned, as text and JSON.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/load/load.h"
#include "stages/load/planned.h"

namespace lamina::pipeline {

/// A page about a part, as in its file: format, counts, size in mm, volume, whether it is closed and where it is not,
/// what was noticed, and what `lamina jet` will do about it: the volume that is planned (planned.h), and the share of the
/// surface that caps of openings are. Lines end with LF, the last one too. Counts and volume are of all build items together.
///
/// options  as for a job; the mesh is diagnosed before any repair, even if options.repair is on
/// surplus  slices where shells overlap; without it they count as often as they do
/// errors   of load(): a file that cannot be planned; of surplus
/// cost     a load, a diagnosis (diagnose.h), a second load and diagnosis with repair if the mesh is not closed, and
///          some seconds of slicing where shells or objects overlap
Result<std::string> describe_part_text(const std::string& path, const load::LoadOptions& options,
                                       const load::SurplusAreas& surplus = {});

/// The same as one JSON object on a line. Places are in mm, in the coordinates of the file after options.transform; triangles
/// count from 1.
Result<std::string> describe_part_json(const std::string& path, const load::LoadOptions& options,
                                       const load::SurplusAreas& surplus = {});

}  // namespace lamina::pipeline
