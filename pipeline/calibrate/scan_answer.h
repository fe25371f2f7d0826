// pipeline/calibrate/scan_answer.h: the answers of lamina-scan as JSON.
#pragma once

#include "stages/calibration/scan/compare.h"
#include "stages/calibration/scan/reading.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// What chart_job.h takes over: lengths in um, as the keys say; null where the photograph does not show them.
Json reading_json(const calibration::ChartReading& reading);
/// Lengths in mm from the upper left corner of the layer's image.
Json comparison_json(const calibration::Comparison& comparison);

}  // namespace lamina::pipeline
