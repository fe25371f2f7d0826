// stages/scan/dashes.h: what is seen of each dash of a chart.
#pragma once

#include <vector>

#include "stages/data/picture/chart.h"
#include "stages/scan/photo.h"
#include "stages/scan/sheet_fit.h"

namespace lamina::scan {

/// Lengths in mm of the sheet, in the directions of x and y of its image.
struct DashSeen {
  double mass = 0;      // darkness across the dash, summed: mm of full black
  double ground = 0;    // darkness beside it
  Spot place;           // of its middle; meaningful if it is there
  bool there = false;   // it was printed
  bool hidden = false;  // too dark for a dash, or out of the picture: nothing can be told
};

/// Looks at each dash where the fit puts it.
/// returns  one for each dash of the chart
/// cost     some thousand samples a dash
std::vector<DashSeen> see_dashes(const Photo& photo, const Chart& chart, const SheetFit& fit);

/// Darkness along a line, averaged over a stripe about it: from -reach to reach, evenly; empty if it leaves the picture.
/// reach, half  mm, of the line on either side of the middle and of the stripe's width
std::vector<double> stripe(const Photo& photo, const View& view, const Spot& middle, bool along_x, double reach, double half);

}  // namespace lamina::scan
