// stages/geometry/travel/edge_grid.h: the edges of a layer's contours in square cells, for questions about short lines.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"

namespace lamina::travel {

inline double length_nm(Point2 a, Point2 b) {
  return std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
}

/// Immutable once built; usable from any thread. Decisions are exact: integers, 128 bits in between.
///
/// cost    building: linear in the points, as cells are at least half as wide as the mean edge is long;
///         crosses(): the cells along the line; contains(): the cells of a row
/// memory  at most kBytesOfPoint for each point and kBytesOfGrid
class EdgeGrid {
 public:
  static constexpr std::size_t kBytesOfPoint = 64, kBytesOfGrid = 256;

  EdgeGrid() = default;
  /// contours  clean; must outlive this object
  explicit EdgeGrid(const ContoursView& contours);

  /// Whether a line meets an edge; touching it counts.
  bool crosses(Point2 a, Point2 b) const;
  /// Whether a point is in the region. Points on an edge count as either.
  bool contains(Point2 p) const;
  /// An edge that a line meets. at  share of the line, 0 to 1, rounded
  struct EdgeCrossing {
    double at;
    std::uint32_t edge;
    friend auto operator<=>(const EdgeCrossing&, const EdgeCrossing&) = default;
  };
  /// All edges that a line meets, in its direction. found  replaced
  void crossings(Point2 a, Point2 b, Buffer<EdgeCrossing>& found) const;

  // An edge has the number of its first point.
  Point2 from(std::uint32_t edge) const { return contours_.point[edge]; }
  Point2 to(std::uint32_t edge) const { return contours_.point[next_[edge]]; }
  std::uint32_t next(std::uint32_t edge) const { return next_[edge]; }
  std::uint32_t before(std::uint32_t edge) const;
  std::uint32_t contour_of(std::uint32_t edge) const;

  std::size_t bytes() const { return bytes_held(next_) + bytes_held(begin_) + bytes_held(edge_); }

 private:
  template <class Visit>
  bool walk(Point2 a, Point2 b, const Visit& visit) const;
  std::int64_t column(double x) const;
  std::int64_t row(double y) const;

  ContoursView contours_;
  Buffer<std::uint32_t> next_;   // of each edge, in its contour
  Buffer<std::uint32_t> begin_;  // cells + 1, by rows: the edges of a cell are edge_[begin_[c] .. begin_[c + 1])
  Buffer<std::uint32_t> edge_;
  Point2 low_{0, 0};
  double cell_ = 1;  // nm
  std::int64_t columns_ = 0, rows_ = 0;
};

}  // namespace lamina::travel
