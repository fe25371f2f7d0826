// stages/calibration/scan/reading.h: reads a photograph of a chart, and reports on the head that printed it.
#pragma once

#include <vector>

#include "stages/calibration/scan/blocks.h"
#include "stages/calibration/scan/dashes.h"
#include "stages/calibration/scan/nozzles.h"
#include "stages/calibration/scan/sheet_fit.h"
#include "stages/data/chart.h"
#include "stages/data/status.h"

namespace lamina::calibration {

struct ChartReading {
  SheetFit fit;
  std::vector<DashReading> dashes;  // in the order of the chart
  double pixels_a_mm = 0;           // of the photograph
  double scatter_um = 0;            // median distance of dashes from where the fit puts them
  HeadReading head;
  InkReading inks;
  std::vector<JointReading> stitches;
};

/// Reads a chart.
/// errors  kInput: the chart is not found, or fewer than a tenth of its dashes
/// cost    some seconds for a thousand nozzles
Result<ChartReading> read_chart_photo(const Photo& photo, const Chart& chart);

/// The photograph with a sign on every dash: green detected, red not detected, orange hidden; the marks in blue.
cv::Mat picture_of(const Photo& photo, const Chart& chart, const ChartReading& reading);

}  // namespace lamina::calibration
