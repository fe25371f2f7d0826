// stages/segment/resolve.h: resolves a segmentation from its settings and the calibration.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/status.h"
#include "stages/segment/calibration.h"
#include "stages/segment/predict.h"
#include "stages/segment/settings.h"

namespace lamina::segment {

/// Absent widths, speeds and spacings come from the calibration, in proportion to the bead.
/// bead_mm  width of the filling's beads, > 0
/// errors   of check(): kUsage, one line that begins with the key's name
Result<Segmentation> resolve(const SegmentSettings& settings, const Calibration& calibration, double bead_mm);

/// Centre-to-centre distances, mm, from each line to the next, in turn from line 0.
/// first  number of a segmented line
std::vector<double> line_distances(const Segmentation& segmentation, std::int32_t first);

}  // namespace lamina::segment
