// pipeline/show/report_places.h: where --inspect found something, for the page of a report.
#pragma once

#include <string>

#include "pipeline/job/job.h"
#include "stages/write/manifest/manifest.h"
#include "stages/write/report/head.h"

namespace lamina::pipeline {

/// Adds the warnings and places of the job's inspection.json to what was seen; nothing if there is none of this job.
/// directory  of the manifest. mirror  of the images, on which places are then shown
void add_inspection(const std::string& directory, const ManifestHead& head, Mirror mirror, write::report::LayersSeen& seen);

}  // namespace lamina::pipeline
