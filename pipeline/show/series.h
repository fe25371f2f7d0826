// pipeline/show/series.h: the layers of a sliced job, or of a G-code file, as shapes to draw.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/formats/gcode/read_gcode.h"
#include "stages/view/drawable_layers.h"

namespace lamina::pipeline {

/// Layers of a file from lamina extrude or another slicer: beads by type, at true width, with a shade per width.
/// errors  of formats::GcodeFile
Result<view::LayerSeries> gcode_series(const std::string& path, const formats::GcodeOptions& options = {});

/// The job of lamina slice in a directory (job.toml), planned again from its parts.
/// errors  kUsage; kInput: an unreadable part. Of a layer: kUsage: no layer of that number; kVerification: a changed part
Result<view::LayerSeries> slice_series(const std::string& directory);

}  // namespace lamina::pipeline
