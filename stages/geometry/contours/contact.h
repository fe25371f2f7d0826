// stages/geometry/contours/contact.h: do contours keep clear of each other and of themselves?
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"

namespace lamina {

struct MonotoneChain {
  std::uint32_t contour, begin, edges;  // from point `begin` of all on, wrapping at the contour's end
  Point2 lo, hi;
  std::uint32_t region = 0;  // chains of different regions are separated by lines along an axis
};

struct ContourBox {
  Point2 lo, hi;
  std::uint32_t contour;
};

/// Reused from layer to layer.
struct ContactScratch {
  // --- contours that are compared by halving
  Buffer<MonotoneChain> chain;
  Buffer<std::uint32_t> open;
  Buffer<ContourBox> box;                                   // of contours, region by region
  Buffer<std::uint32_t> region;                             // of each contour
  Buffer<std::pair<std::uint32_t, std::uint32_t>> contact;  // contours, one with itself too; some may come more than once
  // --- and by cells
  Buffer<std::uint32_t> offset;   // cells + 1
  Buffer<std::uint32_t> edge;     // of each cell: the number of an edge's first point
  Buffer<std::uint32_t> next;     // point -> next point of its contour
  Buffer<std::uint32_t> contour;  // point -> its contour
  Buffer<std::uint32_t> root;     // contour -> another one of its group

  std::uint64_t bytes() const {
    return bytes_held(chain) + bytes_held(open) + bytes_held(box) + bytes_held(region) + bytes_held(contact) +
           bytes_held(offset) + bytes_held(edge) + bytes_held(next) + bytes_held(contour) + bytes_held(root);
  }
};

/// Leaves in scratch.contact enough of the pairs of contours in contact (find_contacts() says what that is) to join every
/// group of them.
///
/// returns  false if the contours wind so much, or lie so close, that a grid is better; what is found then is void
/// cost     O(P) for P points, else gives up after a few comparisons a point
bool find_monotone_contacts(const ContoursView& contours, ContactScratch& scratch);

inline constexpr std::uint32_t kNoContact = UINT32_MAX;

/// Groups contours by contact: two are in contact if an edge of one shares a point with an edge of the other, exactly,
/// and a contour is in contact with itself if two of its edges that are not neighbours share a point. Contours without
/// straight or repeated points (simplify.h) that are in no contact are simple and apart from all others, so they need no
/// boolean operation.
///
/// group    for each contour the lowest contour of its group, or kNoContact
/// returns  whether there is any contact
/// cost     O(P) as a rule: smooth contours are compared by halving, others edge by edge within the cells of a
///          grid about as fine as they are long
bool find_contacts(const ContoursView& contours, ContactScratch& scratch, Buffer<std::uint32_t>& group);

// --- whether two straight stretches share a point, exactly.

/// Twice the area of a triangle, nm^2: above 0 if p lies left of the line from a to b, below 0 right of it.
inline std::int64_t doubled_area(Point2 a, Point2 b, Point2 p) {
  // Coordinates of a bed differ by less than 2^31, so nothing overflows.
  return (std::int64_t{b.x} - a.x) * (std::int64_t{p.y} - a.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{p.x} - a.x);
}

inline int sign(std::int64_t v) { return v > 0 ? 1 : v < 0 ? -1 : 0; }
/// 1: p lies left of the line from a to b, -1: right of it, 0: on it.
inline int side_of(Point2 a, Point2 b, Point2 p) { return sign(doubled_area(a, b, p)); }

/// Whether the boxes around stretches ab and cd share a point.
inline bool boxes_meet(Point2 a, Point2 b, Point2 c, Point2 d) {
  return std::max(a.x, b.x) >= std::min(c.x, d.x) && std::max(c.x, d.x) >= std::min(a.x, b.x) &&
         std::max(a.y, b.y) >= std::min(c.y, d.y) && std::max(c.y, d.y) >= std::min(a.y, b.y);
}

/// Whether stretches ab and cd share a point, ends included.
inline bool intervals_meet(Point2 a, Point2 b, Point2 c, Point2 d) {
  // Boxes meet, so collinear stretches do.
  return boxes_meet(a, b, c, d) && side_of(a, b, c) * side_of(a, b, d) <= 0 && side_of(c, d, a) * side_of(c, d, b) <= 0;
}

/// nm from a point to the nearest one of a stretch, in floating point.
inline double distance_to(Point2 p, Point2 a, Point2 b) {
  const double ux = static_cast<double>(b.x) - a.x, uy = static_cast<double>(b.y) - a.y;
  const double vx = static_cast<double>(p.x) - a.x, vy = static_cast<double>(p.y) - a.y;
  const double length2 = ux * ux + uy * uy;
  const double share = length2 > 0 ? std::clamp((ux * vx + uy * vy) / length2, 0.0, 1.0) : 0;
  return std::hypot(vx - share * ux, vy - share * uy);
}

}  // namespace lamina
