// pipeline/calibrate/pieces.h: test pieces for a printer that nothing is known of; widths.h reads what is measured on them.
//
// The procedure is that of Di Nisio 2022, Appendix A: 1 parameters, 2 flow, 3 level, 4 widths of thick and thin stretches,
// 5 spacings, 6 one layer, 7 the part. docs/calibrate.md tells it for people.
#pragma once

#include <array>
#include <atomic>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/machine/extruder.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct CalibrationRequest {
  std::string machine;                                           // as --machine takes it
  std::string directory;                                         // of the pieces
  double width_mm = 0, height_mm = 0;                            // of a bead; 0: the nozzle, and three quarters of it
  std::vector<double> thin_speeds, thin_extrusions, extrusions;  // %; presets are the document's
};

/// The preset sweeps of Tables 3 to 5.
CalibrationRequest preset_calibration();

/// A test piece: a block, and how it is filled.
struct TestPiece {
  std::string name;  // of its files: 4-speed
  std::string task;  // what to do with it, one line
  std::array<double, 3> size_mm;
  Job job;  // complete but for the paths of its part and output
};

/// Sets the width and height of a bead that the request leaves to the machine.
void resolve_bead(CalibrationRequest& request, const ExtruderProfile& profile);

/// The pieces of steps 2 to 7 of a request whose bead is resolved.
std::vector<TestPiece> test_pieces(const CalibrationRequest& request);

/// Writes DIR/<name>.stl, .toml and .gcode (or .sml) of each piece, DIR/widths.csv to be filled in, and DIR/STEPS.md.
/// returns names of the pieces
/// errors  kUsage: the directory has a widths.csv already; kOutput; of run
Result<std::vector<std::string>> write_test_pieces(const CalibrationRequest& asked, const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
