// pipeline/calibrate/calibrate.h: a printer's test pieces (stages/segment/pieces.h), and its profile from what was measured.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "pipeline/machine/extruder.h"
#include "pipeline/machine/profiles.h"
#include "stages/data/status.h"
#include "stages/segment/measured.h"
#include "stages/segment/pieces.h"

namespace lamina::pipeline {

struct CalibrationRequest {
  std::string machine;           // as --machine takes it
  std::string directory;         // of the pieces
  segment::PieceRequest pieces;  // a bead of 0: the nozzle, and three quarters of it
};

/// Writes DIR/<name>.stl, .toml and .gcode (or .sml) of each piece, DIR/widths.csv to be filled in, and DIR/STEPS.md.
/// returns names of the pieces
/// errors  kUsage: the directory has a widths.csv already; kOutput; of run
Result<std::vector<std::string>> write_test_pieces(CalibrationRequest request, const std::atomic<bool>& cancel);

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
