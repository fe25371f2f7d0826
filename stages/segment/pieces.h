// stages/segment/pieces.h: test pieces for an uncalibrated printer, the table of the widths that are measured on them, and what
// the printer makes of speed and extrusion according to it.
//
// The procedure is that of Di Nisio 2022, Appendix A: 1 parameters, 2 flow, 3 level, 4 widths of thick and thin segments,
// 5 spacings, 6 one layer, 7 the part. docs/howto/calibrate.md describes it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/segment/calibration.h"

namespace lamina::segment {

struct PieceRequest {
  double width_mm = 0, height_mm = 0;                            // of a bead
  std::vector<double> thin_speeds, thin_extrusions, extrusions;  // %, of the sweeps
};

/// The sweeps of the document's Tables 3 to 5; no bead.
PieceRequest preset_pieces();

/// A test piece: a block and its filling.
struct TestPiece {
  std::string name;  // of its files: 4-speed
  std::string task;  // what to do with it, one line
  std::array<double, 3> size_mm;
  std::uint32_t walls = 1;
  bool lines = true;                            // parallel lines within the walls
  std::optional<double> gap_mm{};               // between lines, edge to edge
  std::optional<double> distance_mm{};          // of lines, centre to centre; the first one lies half as far from the edge
  bool segmented = true;                        // thick and thin segments in turn
  std::optional<double> thick_mm{}, thin_mm{};  // lengths of the one thin segment of a line and the thick ones at its ends
  double thick_extrusion = 100;                 // %
  std::optional<double> thick_speed{}, thin_speed{};               // %
  std::vector<double> thin_speed_sweep{}, thin_extrusion_sweep{};  // %, of the lines in turn
};

/// The pieces of steps 2 to 7, in the order of the steps.
std::vector<TestPiece> test_pieces(const PieceRequest& request);

// --- the table of the widths that are measured on them

/// One row of measurements, mm; what was not measured is absent.
struct Measured {
  enum class Test { kFlow, kSpeed, kExtrusion, kRepeated } test;
  double percent = 100;              // kSpeed: of thin segments; kExtrusion: of thin segments; kRepeated: of whole lines
  double thick_speed_percent = 100;  // kRepeated
  std::string region;                // kRepeated: of the part; several rows of one region are averaged
  std::optional<double> wall, thick, thin, continuous, stable;
  std::size_t row = 0;  // for messages
};

/// The rows of a completed table. errors  kInput: file, line, column, reason
Result<std::vector<Measured>> read_widths(const std::string& path);

// --- widths -> what the printer makes of speed and extrusion
//
// Speeds and extrusions of thin segments are measured line by line, then repeated short segments in the initial, the central
// and the final region of the part. Of the thick speeds tried for an extrusion the one at which widths change least along the
// part is taken (step 4), and spacings follow from the widths at that speed (step 5).

struct MeasuringSettings {
  double width_mm = 0.4, height_mm = 0.3, speed_mm_s = 15;  // what 100 % meant while the pieces were printed
  double thin_speed_percent = 200;                          // of the repeated segments
  double flow = 1;                                          // that walls were printed with
  double gap_mm = 0;                                        // wanted between beads
  bool exact_spacing = false;  // from the mean widths; else as the document rounds them (published_spacing)
};

/// What was found for one extrusion of repeated segments.
struct Settled {
  Calibration::Repeated widths;
  Spacing spacing;
  double deviation_mm;  // largest difference of a width between regions
  std::size_t tried;    // thick speeds
};

struct MeasuredMachine {
  Calibration calibration;
  std::optional<double> flow;       // with which two walls measure twice the width
  std::vector<Settled> settled;     // extrusion increasing
  std::vector<std::string> advice;  // what is to be printed again, and with what; one line each
};

/// A deviation along the part that is accepted: the resolution of the document's printer.
inline constexpr double kAcceptedDeviation = 0.012;

/// source  names the measurements, for people
/// errors  kInput: "row N: ..." where a row lacks a width or repeats one; nothing measured at all
Result<MeasuredMachine> calibrate(const std::vector<Measured>& rows, const MeasuringSettings& settings,
                                  const std::string& source);

}  // namespace lamina::segment
