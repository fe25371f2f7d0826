// stages/raster/mirror.h: an image turned over, as runs.
#pragma once

#include "stages/data/runs.h"

namespace lamina::raster {

/// x: columns are reversed (left becomes right); y: rows are reversed. Both may be requested at once; mirroring twice
/// gives the image back. O(runs + rows).
void mirror(const RunsView& runs, bool x, bool y, Runs& out);

}  // namespace lamina::raster
