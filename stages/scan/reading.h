// stages/scan/reading.h: what a photograph of a chart tells of the head that printed it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stages/data/picture/chart.h"
#include "stages/data/status.h"
#include "stages/data/text/json.h"
#include "stages/scan/dashes.h"

namespace lamina::scan {

/// A shift in um: along the scan, positive where places rise; across it, positive where lines rise.
struct Offset {
  double along_um = 0, across_um = 0;
};

struct ChartReading {
  View view;
  std::vector<Spot> shift_mm;                     // of each swath, on the image
  std::vector<DashSeen> dashes;                   // in the order of the chart
  double pixels_a_mm = 0;                         // of the photograph
  double scatter_um = 0;                          // median distance of dashes from where view and shifts put them
  std::vector<std::uint32_t> blocked, weak;       // nozzles: never seen, seen by times
  std::vector<std::uint32_t> untold;              // nozzles whose dashes are all hidden
  std::vector<std::optional<Offset>> nozzle;      // against the mean of the head, of those that were seen
  std::vector<std::optional<Offset>> swath;       // against the first one; absent: not printed
  double gain_along_um = 0, gain_across_um = 0;   // how far an edge stands out of its pixels
  std::uint32_t bars_along = 0, bars_across = 0;  // that the gains are from
  std::vector<std::pair<double, double>> wedges;  // per cent of pixels, per cent of full ink that is seen
};

/// Reads a chart.
/// errors  kInput: the chart is not found, or fewer than a tenth of its dashes
/// cost    some seconds for a thousand nozzles
Result<ChartReading> read_chart_photo(const Photo& photo, const Chart& chart);

Json reading_json(const ChartReading& reading);

/// The photograph with a sign on every dash: green seen, red not seen, orange hidden; the marks in blue.
cv::Mat picture_of(const Photo& photo, const Chart& chart, const ChartReading& reading);

}  // namespace lamina::scan
