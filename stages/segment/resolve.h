// stages/segment/resolve.h: a segmentation as it will be laid, from what is asked for and what was measured.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/status.h"
#include "stages/segment/calibration.h"
#include "stages/segment/predict.h"
#include "stages/segment/settings.h"

namespace lamina::segment {

/// Widths, speeds and spacings that the settings leave open are those of the calibration, in proportion to the bead.
/// bead_mm  width of the filling's beads, > 0
/// errors   of check(): kUsage, one line that begins with the key's name
Result<Segmentation> resolve(const Settings& settings, const Calibration& calibration, double bead_mm);

/// Centre to centre, mm, from each line to the next one, in turn from line 0.
/// first  number of a segmented line
std::vector<double> line_distances(const Segmentation& segmentation, std::int32_t first);

}  // namespace lamina::segment
