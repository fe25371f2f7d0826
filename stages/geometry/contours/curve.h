// stages/geometry/contours/curve.h: the curve that the edges of a contour make when each moves along its normal.
#pragma once

#include <span>
#include <vector>

#include "stages/data/contours.h"

namespace lamina {

/// Moves contours by one distance, one after the other. Buffers are reused.
class OffsetCurve {
 public:
  /// distance  nm to the right of the edges: outwards
  explicit OffsetCurve(double distance) : distance_(distance) {}

  /// Appends the curve of a closed contour as one contour: what it goes round once is the region, the contour's solid being on
  /// the left. A corner that closes is one point if its edges are long enough, else a loop by way of the contour's corner.
  /// returns  whether there is no such loop
  bool append(std::span<const Point2> points, Contours& out);

 private:
  struct Edge {
    double nx, ny, length;  // unit normal to the right
    Point2 end;
  };

  bool corner(const Edge& in, const Edge& out, Contours& to) const;

  double distance_;
  std::vector<Edge> edges_;
};

}  // namespace lamina
