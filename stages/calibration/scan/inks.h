// stages/calibration/scan/inks.h: what bars and wedges of a chart show: ink spread at edges, and darkness by the coverage of
// pixels.
#pragma once

#include <cstdint>
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

}  // namespace lamina::calibration
