// pipeline/show/series.h: the layers of a sliced job, or of a G-code file, as shapes to look at.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/view/shapes.h"

namespace lamina::pipeline {

/// Layers of a file that lamina extrude or another slicer wrote: beads by what they are for, in their true widths, wide
/// and narrow ones of a kind in different shades.
/// errors  of read::GcodeFile
Result<view::LayerSeries> gcode_series(const std::string& path);

/// The job that lamina slice left in a directory (job.toml), planned again from its parts.
/// errors  kUsage; kInput: a part that cannot be read. Of a layer: kUsage: there is none of that number; kVerification: a part
///         that is not what it was
Result<view::LayerSeries> slice_series(const std::string& directory);

}  // namespace lamina::pipeline
