// stages/geometry/contours/offset.h: clean contours grown or shrunk, with mitered corners.
//
//   contours ─> curves ─> tidy ─> find_contacts ─> nest ─> contours
//                 └─────────────────┴─> curve_union, of those with loops or in contact
//
// A curve is what the edges of a contour become when each moves along its normal. Curves without loops that keep clear of each
// other and of themselves are the result; boolean operations are made only where edges vanish on the way, or the region
// divides, merges or vanishes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/contours.h"
#include "stages/data/status.h"

namespace lamina {

/// The region of clean contours grown by `distance` nm, shrunk where it is negative, as clean contours, each outer one followed
/// by its holes; pieces that shrink away are gone. Straight edges keep their distance to within 1 nm of rounding. Corners that
/// open are sharp up to twice the distance from the corner, and beyond cut off square at the distance.
///
/// contours  each outer one followed by the holes in it
/// errors    kInternal of the clipping library
/// cost      O(P) for P points where no edge vanishes; else O((P + X) log P) for an outer contour and its holes, X crossings
Result<Contours> offset_mitered(const ContoursView& contours, std::int64_t distance);

// --- the curve that the edges of a contour make when each moves along its normal.

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
  struct OffsetEdge {
    double nx, ny, length;  // unit normal to the right
    Point2 end;
  };

  bool corner(const OffsetEdge& in, const OffsetEdge& out, Contours& to) const;

  double distance_;
  std::vector<OffsetEdge> edges_;
};

}  // namespace lamina
