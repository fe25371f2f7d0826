// stages/checks/carried.h: whether the region of the layer below certainly carries a component, without boolean operations.
//
// A point that is in the region below, or within the reach of its boundary, is carried. An edge is carried if both ends are
// within the reach of the same edge below (the set of such points is convex), or if it is inside and meets no edge below; an
// edge that is neither is divided. If the boundary of a component is carried, only holes below that are wider than twice the
// reach can hang in its interior.
#pragma once

#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/status.h"
#include "stages/geometry/contours/edge_bands.h"

namespace lamina::checks {

/// The region of a layer, prepared for components above it. Buffers are reused.
struct RegionBelow {
  ContoursView contours;
  Buffer<PlanarBox> box;           // of each contour
  Buffer<std::uint32_t> by_start;  // contours by their first points
  Buffer<Point2> uncarried;        // a point of each piece of its holes that is beyond the reach
  Buffer<PlanarBox> uncarried_box;
  EdgeBands bands;

  /// own  the contours above; a hole that is in both, without an island, cannot hang. reach  nm. errors  of offset_contours
  /// cost  O(P) unless holes are rough
  Status prepare(const ContoursView& below, const ContoursView& own, std::int64_t reach);
  /// Whether it has this very contour.
  bool has(std::span<const Point2> contour) const;
};

/// Whether a component, an outer contour and its holes, certainly shares area with the region below. false: it may not.
bool shares_area(const ContoursView& component, const RegionBelow& below);

/// Appends boxes of what may be beyond the reach that the region was prepared with: of edges, and of pieces of holes below. All
/// that is beyond it is connected to one of them, within the component. None: the component is carried.
/// cost  O(P) times the edges of a band
void find_uncarried(const ContoursView& component, const RegionBelow& below, std::int64_t reach, std::vector<PlanarBox>& boxes);

/// A point of a component: the middle of its longest chord half-way up.
Point2 point_within(const ContoursView& component);

}  // namespace lamina::checks
