// stages/calibration/scan/stitches.h: what verniers and blocks over the stitch lines of swaths measure, in addition to the
// swath offsets from all dashes.
#pragma once

#include <optional>
#include <vector>

#include "stages/calibration/scan/inks.h"
#include "stages/calibration/scan/nozzles.h"
#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/sheet_fit.h"
#include "stages/data/chart.h"

namespace lamina::calibration {

/// How far a swath lies from the one before, the offsets of the nozzles that print its joint taken off; in um, positive as
/// offsets are.
struct JointReading {
  std::uint32_t swath = 0;
  std::optional<double> along_um;  // by its vernier; absent: no vernier, or too little of it is detected
  std::optional<double>
      across_um;       // by the height of its block; absent: its outermost nozzles are blocked, or no gain is known
  bool agrees = true;  // with the swaths' offsets, within a quarter of a pixel along the scan and one across it
};

/// Of all joints between swaths that were printed.
std::vector<JointReading> read_stitches(const Photo& photo, const Chart& chart, const SheetFit& fit, const HeadReading& head,
                                        const InkReading& inks);

}  // namespace lamina::calibration
