// stages/calibration/scan/sheet_fit.h: the view of a chart, the shifts of its swaths and the offsets of its nozzles, from where
// dashes lie.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "stages/calibration/scan/view.h"

namespace lamina::calibration {

/// A dash: where it should lie on the sheet in mm, and where the photograph has it, in pixels.
struct Sighting {
  Spot position, detected;
  std::uint32_t swath = 0, nozzle = 0, repeat = 0;
};

/// A dash is detected at its view.at() position, moved by the shift of its swath and the offset of its nozzle, in mm.
struct SheetFit {
  View view;
  std::vector<Spot> shift;    // of each swath; the one that shifts count from has none
  std::vector<Spot> offset;   // of each nozzle; undetected ones have none
  double scatter_pixels = 0;  // median distance of a dash from there
};

/// All of them together, by Gauss and Newton with Tukey's weights: outliers (dust) count nothing. A nozzle's own offset is an
/// unknown, so that it bends neither the view nor the shifts. What cannot be determined (a straight line through the offsets
/// against the scale of the view and the shifts) is kept small. fit    where it begins, of all swaths and nozzles; changed
/// first  the swath that shifts count from lens   whether to fit one cost   O(sightings x unknowns of view and swaths^2) for
/// each of some ten steps
void fit_sheet(const std::vector<Sighting>& sightings, std::uint32_t first, bool lens, SheetFit& fit);

/// The straight line, value = middle + slope x index, whose slope is the median of all pairs' (Theil 1950, Sen 1968) and which
/// has as many values above as below. values  of index, by pairs; at least one
/// cost  O(pairs), of at most some 500 values evenly chosen
struct HeadLine {
  double middle = 0, slope = 0;
  double at(double index) const { return middle + slope * index; }
};
HeadLine line_of(const std::vector<std::pair<double, double>>& values);

}  // namespace lamina::calibration
