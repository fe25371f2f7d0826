// stages/formats/gcode/replay/wall_crossings.h: travels without retraction that cross an outer wall of their layer.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stages/formats/gcode/replay/defects.h"

namespace lamina::formats::gcode {

/// Collects the outer walls and travels of a layer, deposited in any order, and counts the travels that cross a wall, at its
/// end. Travels that begin or end at a wall do not cross it.
///
/// memory  of the largest layer: 20 bytes a wall's bead, 40 a travel
class WallCrossings {
 public:
  static constexpr double kTouchMm = 0.2;  // from the ends of a travel

  void wall(const double* from, const double* to);
  /// Positions that no bed has are left out.
  void travel(const double* from, const double* to, FileLine at);
  /// Counts, and begins the next layer. cost  O(walls + cells of the travels)
  void end_layer(Defects& defects);

 private:
  struct WallSegment {
    std::array<float, 4> ends;  // x, y, x, y in mm
  };
  struct OpenTravel {
    std::array<double, 4> ends;
    FileLine at;
  };
  void sort_walls();
  bool crosses(const OpenTravel& travel) const;
  /// Calls visit(first, last), the cells that a segment within the grid passes, row by row, until it returns true. returns
  /// whether it did
  template <class Visit>
  bool each_row(const std::array<double, 4>& ends, Visit visit) const;
  std::uint32_t cell_of(double at, std::size_t axis) const;

  std::vector<WallSegment> walls_;
  std::vector<OpenTravel> travels_;
  // A grid over the walls: offset has cells + 1 entries into cell_walls_.
  std::array<double, 2> low_{}, high_{};
  double step_ = 1;
  std::array<std::uint32_t, 2> cells_{};
  std::vector<std::uint32_t> offset_, cell_walls_;
};

}  // namespace lamina::formats::gcode
