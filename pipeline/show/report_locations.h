// pipeline/show/report_locations.h: where --inspect found something, for the page of a report.
#pragma once

#include <string>

#include "pipeline/manifest/manifest.h"
#include "pipeline/show/report_head.h"

namespace lamina::pipeline {

/// Adds the warnings and places of the job's inspection.json to the findings; nothing without a file of this job.
/// directory  of the manifest. mirrored  whether columns and rows of the images are, on which places are then shown
void add_inspection(const std::string& directory, const ManifestHead& head, bool mirrored_x, bool mirrored_y,
                    ReportLayers& detected);

}  // namespace lamina::pipeline
