// pipeline/calibrate/calibrate.h: a printer's test pieces (stages/segment/pieces.h), and its profile from their measurements.
#pragma once

#include <atomic>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/machine/profiles.h"
#include "stages/data/status.h"
#include "stages/segment/pieces.h"

namespace lamina::pipeline {

/// The empty widths.csv (stages/segment/pieces.h): one row per line of the pieces.
std::string widths_text(const segment::PieceRequest& request);

struct CalibrationRequest {
  std::string machine;           // as --machine takes it
  std::string directory;         // of the pieces
  segment::PieceRequest pieces;  // a bead of 0: nozzle diameter wide, three quarters of it high
  bool overwrite = false;        // pieces of an earlier call
};

/// Writes DIR/<name>.stl, .toml and .gcode (or .sml) for each piece, DIR/widths.csv to fill in, and DIR/STEPS.md.
/// returns names of the pieces
/// errors  kUsage: widths.csv exists already, or another of them without overwrite; kOutput; of run; what was written is
///         removed again
Result<std::vector<std::string>> write_test_pieces(CalibrationRequest request, const std::atomic<bool>& cancel);

struct CalibratedProfile {
  ExtruderProfile profile;
  std::string toml;  // of the profile's file
  segment::MeasuredMachine found;
};

/// The profile of request.machine with the spacings and speeds computed from a completed widths.csv.
/// gap_mm  between thick beads and their neighbours
/// exact   spacings use the unrounded mean widths; otherwise 0.01 mm as in the document
/// errors  of read_widths and segment::calibrate; kUsage: no such machine; kInput: the widths give an invalid profile
Result<CalibratedProfile> calibrate_profile(CalibrationRequest request, const std::string& widths, double gap_mm, bool exact);

}  // namespace lamina::pipeline
