// stages/geometry/contours/edge_bands.h: the edges of contours in horizontal bands, for points and intervals near them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"

namespace lamina {

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

/// By the rule of half-open edges. cost  all edges
bool is_inside(std::span<const Point2> contour, Point2 p);
bool is_inside(const ContoursView& contours, Point2 p);

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
  /// Whether bands have so many edges that comparing all with all in them takes long.
  bool is_crowded() const;
  /// Whether an interval shares a point with an edge.
  bool meets(Point2 a, Point2 b) const;

 private:
  struct BandEdge {
    Point2 a, b;
  };
  std::int64_t band_of(std::int64_t y) const {
    return std::clamp<std::int64_t>((y - box_.lo.y) / height_, 0, static_cast<std::int64_t>(offset_.size()) - 2);
  }
  PlanarBox box_;
  std::int64_t height_ = 1;
  Buffer<std::uint32_t> offset_;  // bands + 1
  Buffer<BandEdge> edge_;         // an edge is in each band that it reaches
};

/// Whether a region is within another one, without boolean operations. Buffers are reused.
class ContainmentTest {
 public:
  /// inner  clean contours, which stay where they are
  void set_inner(const ContoursView& inner);
  /// outer    clean contours
  /// returns  true if all edges keep clear of each other and the inner region is within the outer one. false: it may not be, or
  ///          too many edges are next to each other
  /// cost     O(P) times the edges of the bands that an edge reaches; of a band there are at most 256 on average
  bool certainly_in(const ContoursView& outer);

 private:
  ContoursView inner_;
  EdgeBands inner_bands_, outer_bands_;
};

}  // namespace lamina
