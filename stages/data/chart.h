// stages/data/chart.h: the elements of a calibration chart of a powder printer and their positions. The chart is arranged by
// stages/calibration/chart and read back from a photograph by stages/calibration/scan.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace lamina {

/// Pixels of the layer image, ends exclusive; row 0 is the back of the bed.
struct ChartBox {
  std::uint32_t left = 0, top = 0, right = 0, bottom = 0;
  bool operator==(const ChartBox&) const = default;
};

/// A line that one nozzle alone prints.
struct ChartDash {
  std::uint32_t swath = 0, nozzle = 0, repeat = 0;
  ChartBox box;
  bool operator==(const ChartDash&) const = default;
};

/// A full bar whose width measures how far drops spread. along: its width is along the scan
struct ChartBar {
  bool along = false;
  ChartBox box;
  bool operator==(const ChartBar&) const = default;
};

/// A patch of which `percent` of the pixels are set.
struct ChartWedge {
  double percent = 0;
  ChartBox box;
  bool operator==(const ChartWedge&) const = default;
};

/// Ticks on either side of the joint before `swath`, across the scan: pair k of 0 .. 2 m lines up where that swath lies k - m
/// places too far along the scan.
struct ChartVernier {
  std::uint32_t swath = 0;
  std::vector<ChartBox> before, after;  // of the swath before and of this one; as many
  bool operator==(const ChartVernier&) const = default;
};

struct Chart {
  std::string machine;                    // its name
  std::uint32_t columns = 0, rows = 0;    // of the image
  double pixel_x_nm = 0, pixel_y_nm = 0;  // pitch
  bool scan_along_x = true;
  int along_sign = 1, across_sign = 1;  // whether places and lines rise with columns and rows, or fall
  std::uint32_t nozzles = 0, nozzle_rows = 1, swaths = 0;
  double between_mm = 0, gap_mm = 0;  // of dashes: across the scan from centre to centre, along it from end to end
  double mark_mm = 0;                 // radius of the marks
  double layer_mm = 0;                // thickness that it is printed with; 0: not stated
  std::vector<ChartBox> marks;        // around the four discs, the first one a ring; clockwise in the image
  std::vector<ChartDash> dashes;
  std::vector<ChartBar> bars;
  std::vector<ChartWedge> wedges;
  std::vector<ChartBox> stitches;      // full blocks over the stitch lines before swath 1, 2 ...; gaps by their height
  std::vector<ChartVernier> verniers;  // none where the bed has no room
  bool operator==(const Chart&) const = default;
};

/// The radius of the hole of the ring, as a share of its own.
inline constexpr double kRingHole = 0.5;

}  // namespace lamina
