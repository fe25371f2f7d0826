// stages/checks/carried.h: whether the region of the layer below certainly carries a component, without boolean operations.
//
// A point that is in the region below, or within the reach of its boundary, is carried. An edge is carried if both ends are
// within the reach of the same edge below (the set of such points is convex), or if it is inside and meets no edge below; an
// edge that is neither is divided. If the boundary of a component is carried, only holes below that are wider than twice the
// reach can hang in its interior.
#pragma once

#include <algorithm>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// Box of contours or edges, nm.
struct PlanarBox {
  Point2 lo{INT32_MAX, INT32_MAX}, hi{INT32_MIN, INT32_MIN};
  void add(const PlanarBox& other) {
    lo = {std::min(lo.x, other.lo.x), std::min(lo.y, other.lo.y)};
    hi = {std::max(hi.x, other.hi.x), std::max(hi.y, other.hi.y)};
  }
  void add(Point2 p) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
  }
  /// Whether they share a point after this box grows by `by`.
  bool meets(const PlanarBox& other, std::int64_t by = 0) const {
    return lo.x - by <= other.hi.x && other.lo.x <= hi.x + by && lo.y - by <= other.hi.y && other.lo.y <= hi.y + by;
  }
};
/// Larger by `by` nm, within the reach of coordinates.
PlanarBox grown(const PlanarBox& box, std::int64_t by);
bool is_within(const PlanarBox& inner, const PlanarBox& outer);
PlanarBox box_around(std::span<const Point2> points);

/// Edges of contours in horizontal bands.
class EdgeBands {
 public:
  /// min_height  nm of a band, > 0
  /// cost        O(P)
  void build(const ContoursView& contours, std::int64_t min_height);

  /// Whether contours wind around a point, or, by the rule of half-open edges, go through it. cost  the edges of one band
  bool inside(Point2 p) const;
  /// Whether a point is within 2 nm of an edge.
  bool touches(Point2 p) const;
  /// Whether an edge is certainly within the reach, nm, of edges; or, if it may be, inside. divisions  of it in two
  bool carries(Point2 a, Point2 b, double reach, bool or_inside = true, int divisions = 5) const;

 private:
  struct BandEdge {
    Point2 a, b;
  };
  std::int64_t band_of(std::int64_t y) const {
    return std::clamp<std::int64_t>((y - box_.lo.y) / height_, 0, static_cast<std::int64_t>(offset_.size()) - 2);
  }
  bool meets(Point2 a, Point2 b) const;

  PlanarBox box_;
  std::int64_t height_ = 1;
  Buffer<std::uint32_t> offset_;  // bands + 1
  Buffer<BandEdge> edge_;         // an edge is in each band that it reaches
};

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
