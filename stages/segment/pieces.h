// stages/segment/pieces.h: test pieces for an uncalibrated printer; measured.h evaluates their widths.
//
// The procedure is that of Di Nisio 2022, Appendix A: 1 parameters, 2 flow, 3 level, 4 widths of thick and thin stretches,
// 5 spacings, 6 one layer, 7 the part. docs/calibrate.md describes it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

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
  bool segmented = true;                        // thick and thin stretches in turn
  std::optional<double> thick_mm{}, thin_mm{};  // lengths of the one thin stretch of a line and the thick ones at its ends
  double thick_extrusion = 100;                 // %
  std::optional<double> thick_speed{}, thin_speed{};               // %
  std::vector<double> thin_speed_sweep{}, thin_extrusion_sweep{};  // %, of the lines in turn
};

/// The pieces of steps 2 to 7, in the order of the steps.
std::vector<TestPiece> test_pieces(const PieceRequest& request);

}  // namespace lamina::segment
