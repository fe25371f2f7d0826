// pipeline/calibrate/widths.h: what was measured on the test pieces of pieces.h, and the profile that follows from it.
#pragma once

#include <string>
#include <vector>

#include "pipeline/calibrate/pieces.h"
#include "pipeline/machine/extruder.h"
#include "stages/data/status.h"
#include "stages/segment/measured.h"

namespace lamina::pipeline {

/// The rows of a filled in widths.csv. errors  kInput: file, line, column, what is wrong
Result<std::vector<segment::Measured>> read_widths(const std::string& path);

struct CalibratedProfile {
  ExtruderProfile profile;
  std::string toml;  // of the profile's file
  segment::MeasuredMachine found;
};

/// The profile of request.machine with the spacings and speeds that follow from a filled in widths.csv.
/// gap_mm  between thick beads and their neighbours
/// exact   spacings from the mean widths, not rounded to 0.01 mm as in the document
/// errors  of read_widths and segment::calibrate; kUsage: no such machine; kInput: widths that make no valid profile
Result<CalibratedProfile> calibrate_profile(CalibrationRequest request, const std::string& widths, double gap_mm, bool exact);

}  // namespace lamina::pipeline
