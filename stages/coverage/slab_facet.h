// stages/coverage/slab_facet.h: what of a facet lies in a layer.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "stages/coverage/edges.h"
#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::coverage {

// --- what lies behind a piece of a facet, in doubles for all voxels and in rationals for the few that
// doubles do not decide.

template <class Number>
struct Corner {
  Number x, y, z;
};

/// A convex piece of a facet. A triangle that four planes have cut has at most seven corners.
template <class Number>
struct Piece {
  std::array<Corner<Number>, 8> corner;
  std::uint32_t size = 0;
};

/// What of `from` lies on one side of the plane where a coordinate is `limit`: above it, or below.
/// Source: I. Sutherland, G. Hodgman, Reentrant polygon clipping, 1974
template <auto kAxis, bool kAbove, class Number>
void cut(const Piece<Number>& from, const Number& limit, Piece<Number>& to) {
  to.size = 0;
  const auto keeps = [&](const Corner<Number>& c) { return kAbove ? c.*kAxis >= limit : c.*kAxis <= limit; };
  for (std::uint32_t i = 0; i < from.size; ++i) {
    const Corner<Number>& a = from.corner[i];
    const Corner<Number>& b = from.corner[i + 1 == from.size ? 0 : i + 1];
    const bool keeps_a = keeps(a), keeps_b = keeps(b);
    if (keeps_a && to.size < to.corner.size()) to.corner[to.size++] = a;
    if (keeps_a == keeps_b || a.*kAxis == limit || b.*kAxis == limit || to.size >= to.corner.size()) continue;
    const Number share = (limit - a.*kAxis) / (b.*kAxis - a.*kAxis);
    Corner<Number>& c = to.corner[to.size++];
    c.x = a.x + share * (b.x - a.x);
    c.y = a.y + share * (b.y - a.y);
    c.z = a.z + share * (b.z - a.z);
    c.*kAxis = limit;
  }
}

/// Projected along x; positive where +x goes into the solid.
template <class Number>
Number area_along_x(const Corner<Number>& a, const Corner<Number>& b, const Corner<Number>& c) {
  return ((b.z - a.z) * (c.y - a.y) - (b.y - a.y) * (c.z - a.z)) / 2;
}

/// A triangle as what lies behind it, towards +x, sees it: its area along x by x. The area before x rises with the square of
/// the distance from the first corner, and falls short of all by the square of that from the last.
template <class Number>
struct Tent {
  Number x0, x1, x2;  // corners, in order
  Number area;        // projected along x; positive where +x goes into the solid

  Tent() = default;
  Tent(const Corner<Number>& a, const Corner<Number>& b, const Corner<Number>& c) : x0(a.x), x1(b.x), x2(c.x) {
    if (x1 < x0) std::swap(x0, x1);
    if (x2 < x1) std::swap(x1, x2);
    if (x1 < x0) std::swap(x0, x1);
    area = area_along_x(a, b, c);
  }

  Number mean() const { return (x0 + x1 + x2) / 3; }
  /// Area before x.
  Number before(const Number& x) const {
    if (x <= x0) return Number(0);
    if (x >= x2) return area;
    if (x < x1) return area * ((x - x0) * (x - x0) / ((x1 - x0) * (x2 - x0)));
    return area - area * ((x2 - x) * (x2 - x) / ((x2 - x1) * (x2 - x0)));
  }
  /// Volume between the triangle and x, behind it.
  Number behind(const Number& x) const {
    if (x <= x0) return Number(0);
    if (x >= x2) return area * (x - mean());
    if (x < x1) return area * ((x - x0) / 3 * ((x - x0) * (x - x0) / ((x1 - x0) * (x2 - x0))));
    return area * (x - mean()) + area * ((x2 - x) / 3 * ((x2 - x) * (x2 - x) / ((x2 - x1) * (x2 - x0))));
  }
};

// ---

/// Room for `count` elements, an eighth more than that at most; what was in it is lost.
template <class T>
void ensure_capacity(Buffer<T>& buffer, std::size_t count) {
  if (count <= buffer.capacity()) return;
  buffer = {};
  buffer.reserve(count + count / 8);
}

/// How far computed corners may lie from where they are, nm, and more: those of facets of 4 m by 4 million roundings.
inline constexpr double kSlack = 1.0 / 1024;

struct SlabFacet {
  Triangle facet;                     // nm, on the bed
  Point3 low;                         // lowest corner of its box
  Nm size;                            // longest side of its box
  bool edgewise;                      // projected along x it has no area
  bool enters;                        // +x goes into the solid
  bool suspect;                       // it meets others (meet/meetings.h)
  std::uint32_t first_row, last_row;  // geometry rows that it may reach; last_row included
  std::array<double, 5> x, y, z;      // of the piece within the layer, from `low`
  std::uint32_t corners;
};

/// A facet in a row.
struct RowFacet {
  std::uint32_t first = 0, last = 0;  // columns that it may reach; last included
  std::uint32_t index = 0;            // among those of the layer
};

/// What lies behind the piece within the layer, up to where x is `end`, nm^3; negative behind facets that +x leaves through.
double volume_behind(const SlabFacet& facet, double end);

/// Fills in everything; false if nothing of the facet lies between the heights, or it has no area at all.
bool take_facet(const Triangle& on_bed, bool suspect, std::int64_t bottom, std::int64_t top, const Edges& rows, SlabFacet& out);

}  // namespace lamina::coverage
