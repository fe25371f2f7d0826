// pipeline/show/gcode_series.h: the layers of a G-code file as shapes to look at.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/view/shapes.h"

namespace lamina::pipeline {

/// Layers of a file that lamina extrude or another slicer wrote: beads by what they are for, in their true widths, wide
/// and narrow ones of a kind in different shades.
/// errors  of read::GcodeFile
Result<view::LayerSeries> gcode_series(const std::string& path);

}  // namespace lamina::pipeline
