// stages/coverage/volume.h: what lies behind a piece of a facet, in doubles for all voxels and in rationals for the few that
// doubles do not decide.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

namespace lamina::cover {

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

/// Seen along x; positive where +x goes into the solid.
template <class Number>
Number area_along_x(const Corner<Number>& a, const Corner<Number>& b, const Corner<Number>& c) {
  return ((b.z - a.z) * (c.y - a.y) - (b.y - a.y) * (c.z - a.z)) / 2;
}

/// A triangle as what lies behind it, towards +x, sees it: its area along x by x. The area before x rises with the square of
/// the distance from the first corner, and falls short of all by the square of that from the last.
template <class Number>
struct Tent {
  Number x0, x1, x2;  // corners, in order
  Number area;        // seen along x; positive where +x goes into the solid

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

}  // namespace lamina::cover
