// stages/calibration/scan/dashes.h: what is seen of each dash of a chart.
#pragma once

#include <optional>
#include <vector>

#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/shape.h"
#include "stages/calibration/scan/sheet_fit.h"
#include "stages/data/chart.h"

namespace lamina::scan {

/// Lengths in mm of the sheet, in the directions of x and y of its image.
struct DashSeen {
  double mass = 0;      // darkness across the dash, summed: mm of full black
  double ground = 0;    // darkness beside it
  Spot place;           // of its middle; meaningful if it is there
  bool there = false;   // it was printed
  bool hidden = false;  // too dark for a dash, or out of the picture: nothing can be told
  double misfit = 0;    // from the common shape, as a share of its height
  bool marred = false;  // by dust: it is there, but its place is not to be trusted
};

/// The common shapes of all dashes of a photograph, across the scan and along it.
struct DashShapes {
  Shape across, along;
};

/// Looks at each dash where the fit puts it.
/// shapes   by which dashes are placed if there are any, else by centres and ends; replaced by those that were seen
/// returns  one for each dash of the chart
/// cost     some thousand samples a dash
std::vector<DashSeen> see_dashes(const Photo& photo, const Chart& chart, const SheetFit& fit,
                                 std::optional<DashShapes>& shapes);

/// Darkness along a line, averaged over a stripe about it: from -reach to reach, evenly; empty if it leaves the picture.
/// reach, half  mm, of the line on either side of the middle and of the stripe's width
std::vector<double> stripe(const Photo& photo, const View& view, const Spot& middle, bool along_x, double reach, double half);

}  // namespace lamina::scan
