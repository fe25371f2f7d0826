// stages/calibration/scan/blocks.h: what a chart shows next to its dashes. Bars and wedges: the ink spread at edges, and the
// darkness by the coverage of pixels. Verniers and blocks over stitch lines: offsets of swaths, in addition to those from
// dashes.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "stages/calibration/scan/nozzles.h"
#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/sheet_fit.h"
#include "stages/data/chart.h"

namespace lamina::calibration {

struct InkReading {
  double gain_along_um = 0, gain_across_um = 0;   // how far an edge stands out of its pixels
  std::uint32_t bars_along = 0, bars_across = 0;  // that the gains are from
  std::uint32_t bars_detected = 0;                // along the scan, that lie in the photograph
  double full = 0;                                // darkness of full ink, as the widest bars show; 0: not detected
  std::vector<std::pair<double, double>> wedges;  // per cent of pixels, per cent of full ink that was detected
};

InkReading read_inks(const Photo& photo, const Chart& chart, const SheetFit& fit, const HeadReading& head);

/// From the first place to the last where a profile from -reach to reach is half of full ink above its ground, in mm; 0 if it
/// never is. What gaps lie between them does not count, and blur moves neither.
double width_of(const std::vector<double>& profile, double reach, double full);

/// How far a swath lies from the one before, the offsets of the nozzles that print its joint taken off; in um, positive as
/// offsets are.
struct JointReading {
  std::uint32_t swath = 0;
  std::optional<double> along_um;  // by its vernier; absent: no vernier, or too little of it is detected
  std::optional<double>
      across_um;  // by the height of its block; absent: its outermost nozzles are blocked, or no gain is known
  bool agrees =
      true;  // with the swaths' offsets and their limits, within a quarter of a pixel along the scan and one across it
};

/// Of all joints between swaths that were printed.
std::vector<JointReading> read_stitches(const Photo& photo, const Chart& chart, const SheetFit& fit, const HeadReading& head,
                                        const InkReading& inks);

}  // namespace lamina::calibration
