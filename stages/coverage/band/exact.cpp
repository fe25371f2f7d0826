#include "stages/coverage/band/exact.h"

#include <gmpxx.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace lamina::coverage {
namespace {

using Wide = __int128;

struct FacetNormal {
  std::int64_t x, y, z;

  explicit FacetNormal(const Triangle& t) {
    const std::int64_t ux = std::int64_t{t.b.x} - t.a.x, uy = std::int64_t{t.b.y} - t.a.y, uz = std::int64_t{t.b.z} - t.a.z;
    const std::int64_t vx = std::int64_t{t.c.x} - t.a.x, vy = std::int64_t{t.c.y} - t.a.y, vz = std::int64_t{t.c.z} - t.a.z;
    x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
  }
};

Wide magnitude(Wide value) { return value < 0 ? -value : value; }

bool is_within(Nm a, Nm b, Nm c, std::int64_t low, std::int64_t high) {
  return std::max({a, b, c}) > low && std::min({a, b, c}) < high;
}

/// Twice the side of the plane that the voxel's centre is on.
Wide side_of_centre(const FacetNormal& n, const Point3& on, const Voxel& v) {
  return static_cast<Wide>(n.x) * (v.x0 + v.x1 - 2 * std::int64_t{on.x}) +
         static_cast<Wide>(n.y) * (v.y0 + v.y1 - 2 * std::int64_t{on.y}) +
         static_cast<Wide>(n.z) * (v.z0 + v.z1 - 2 * std::int64_t{on.z});
}

/// Whether the plane and the box of a facet meet the inside of the voxel.
bool may_split(const Triangle& t, const FacetNormal& n, const Voxel& v) {
  if (!is_within(t.a.x, t.b.x, t.c.x, v.x0, v.x1) || !is_within(t.a.y, t.b.y, t.c.y, v.y0, v.y1) ||
      !is_within(t.a.z, t.b.z, t.c.z, v.z0, v.z1)) {
    return false;
  }
  const Wide reach = magnitude(n.x) * (v.x1 - v.x0) + magnitude(n.y) * (v.y1 - v.y0) + magnitude(n.z) * (v.z1 - v.z0);
  return magnitude(side_of_centre(n, t.a, v)) < reach;
}

bool in_one_plane(const Triangle& f, const FacetNormal& n, const Triangle& g) {
  const FacetNormal m(g);
  const auto parallel = [](std::int64_t a, std::int64_t b, std::int64_t c, std::int64_t d) {
    return static_cast<Wide>(a) * d == static_cast<Wide>(b) * c;
  };
  if (!parallel(n.x, n.y, m.x, m.y) || !parallel(n.y, n.z, m.y, m.z) || !parallel(n.x, n.z, m.x, m.z)) return false;
  return static_cast<Wide>(n.x) * (std::int64_t{g.a.x} - f.a.x) + static_cast<Wide>(n.y) * (std::int64_t{g.a.y} - f.a.y) +
             static_cast<Wide>(n.z) * (std::int64_t{g.a.z} - f.a.z) ==
         0;
}

// --- one plane: each of its sides is solid or not.

/// A share as the fraction that it is.
struct Fraction {
  std::int64_t above, below;
  double value() const { return static_cast<double>(above) / static_cast<double>(below); }
  std::uint32_t level(std::uint32_t n) const {
    return static_cast<std::uint32_t>((2 * static_cast<Wide>(above) * n + below) / (2 * static_cast<Wide>(below)));
  }
};

/// The part of a voxel on one side of a plane, if it is easily said.
std::optional<Fraction> part_of(const FacetNormal& n, const Point3& on, const Voxel& v) {
  if (n.x == 0 && n.y == 0) return Fraction{on.z - v.z0, v.z1 - v.z0};
  if (n.x == 0 && n.z == 0) return Fraction{on.y - v.y0, v.y1 - v.y0};
  if (n.y == 0 && n.z == 0) return Fraction{on.x - v.x0, v.x1 - v.x0};
  if (side_of_centre(n, on, v) == 0) return Fraction{1, 2};
  return std::nullopt;
}

PlaneLevels levels_of(const Fraction& part, std::uint32_t top_level) {
  const std::array<Fraction, 4> shares{{{0, 1}, part, {part.below - part.above, part.below}, {1, 1}}};
  PlaneLevels levels{};
  for (std::size_t i = 0; i < shares.size(); ++i) {
    levels.share[i] = shares[i].value();
    levels.level[i] = shares[i].level(top_level);
  }
  return levels;
}

// --- any facets: volumes in rationals.

using Rational = mpq_class;
using RationalCorner = Corner<Rational>;

Rational rational(std::int64_t whole) { return Rational(static_cast<long>(whole)); }

/// Sides of a voxel; its lowest corner is the origin.
struct ExactSides {
  Rational width, depth, height;
};

std::array<RationalCorner, 3> corners_in(const Triangle& t, const Voxel& v) {
  const auto corner = [&](const Point3& p) {
    return RationalCorner{rational(p.x - v.x0), rational(p.y - v.y0), rational(p.z - v.z0)};
  };
  return {corner(t.a), corner(t.b), corner(t.c)};
}

/// Volume of the voxel behind what of the facet is within, not on the face before.
Rational behind_facet(const std::array<RationalCorner, 3>& corners, const ExactSides& sides) {
  const Rational zero;
  if (corners[0].x <= zero && corners[1].x <= zero && corners[2].x <= zero) return zero;
  Piece<Rational> one, other;
  for (const RationalCorner& corner : corners) one.corner[one.size++] = corner;
  cut<&RationalCorner::z, true>(one, zero, other);
  cut<&RationalCorner::z, false>(other, sides.height, one);
  cut<&RationalCorner::y, true>(one, zero, other);
  cut<&RationalCorner::y, false>(other, sides.depth, one);
  cut<&RationalCorner::x, true>(one, zero, other);
  cut<&RationalCorner::x, false>(other, sides.width, one);
  Rational sum;
  for (std::uint32_t k = 1; k + 1 < one.size; ++k) {
    const RationalCorner &a = one.corner[0], &b = one.corner[k], &c = one.corner[k + 1];
    sum += area_along_x(a, b, c) * (sides.width - (a.x + b.x + c.x) / 3);
  }
  return sum;
}

/// A point of the face before the voxel.
struct FacePoint {
  Rational y, z;
};

FacePoint between(const FacePoint& a, const FacePoint& b, const Rational& share) {
  return {a.y + share * (b.y - a.y), a.z + share * (b.z - a.z)};
}

/// Area of the face before the voxel that is behind the facet, along y; and behind where it crosses the face's edge, along z.
Rational behind_section(const std::array<RationalCorner, 3>& corners, const ExactSides& sides) {
  const Rational zero;
  std::array<FacePoint, 2> end;  // where the border leaves what is before the face, and where it returns
  int crossings = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const RationalCorner &a = corners[i], &b = corners[(i + 1) % 3];
    const bool before_a = a.x <= zero, before_b = b.x <= zero;
    if (before_a == before_b) continue;
    end[before_a ? 0 : 1] = between({a.y, a.z}, {b.y, b.z}, a.x / (a.x - b.x));
    ++crossings;
  }
  if (crossings != 2) return zero;
  Rational sum;
  const bool before_first = end[0].y <= zero, before_second = end[1].y <= zero;
  if (before_first && before_second) return zero;
  if (before_first != before_second) {
    FacePoint& outside = end[before_first ? 0 : 1];
    outside = between(end[0], end[1], end[0].y / (end[0].y - end[1].y));
    const Rational height = std::clamp(outside.z, zero, sides.height);  // -1 or +1: what a step along z enters
    sum += (before_first ? height - sides.height : sides.height - height) * sides.depth;
  }
  // What of the segment is within the heights of the voxel, then what of that is nearer than its back.
  if (end[0].z == end[1].z) return sum;
  const auto clip = [&](const Rational& z) { return between(end[0], end[1], (z - end[0].z) / (end[1].z - end[0].z)); };
  std::array<FacePoint, 2> within = end;
  for (FacePoint& point : within) {
    if (point.z < zero) point = clip(zero);
    if (point.z > sides.height) point = clip(sides.height);
  }
  const Rational first = sides.depth - within[0].y, second = sides.depth - within[1].y, rise = within[1].z - within[0].z;
  if (first <= zero && second <= zero) return sum;
  if (first >= zero && second >= zero) return sum + (first + second) / 2 * rise;
  const Rational inside = first > zero ? first : second;
  return sum + inside / 2 * rise * (inside / (first > zero ? first - second : second - first));
}

std::uint32_t level_by_volume(const Voxel& v, std::span<const SlabFacet* const> facets, const NearShare& near_share) {
  const ExactSides sides{rational(v.x1 - v.x0), rational(v.y1 - v.y0), rational(v.z1 - v.z0)};
  const Rational whole = sides.width * sides.depth * sides.height;
  Rational volume;
  for (const SlabFacet* facet : facets) {
    const auto corners = corners_in(facet->facet, v);
    volume += behind_facet(corners, sides) + behind_section(corners, sides) * sides.width;
  }
  const Rational share = volume / whole;
  const double outside = std::round(near_share.share - share.get_d());
  const Rational level = (share + Rational(outside)) * static_cast<long>(near_share.top_level) + Rational(1, 2);
  mpz_class below;
  mpz_fdiv_q(below.get_mpz_t(), level.get_num_mpz_t(), level.get_den_mpz_t());
  if (below < 0) return 0;
  return below > near_share.top_level ? near_share.top_level : static_cast<std::uint32_t>(below.get_ui());
}

}  // namespace

std::uint32_t exact_level(const Voxel& voxel, std::span<const SlabFacet* const> near_facets, const NearShare& near_share) {
  const SlabFacet* plane = nullptr;
  bool one_plane = true;
  for (const SlabFacet* facet : near_facets) {
    const FacetNormal normal(facet->facet);
    if (!may_split(facet->facet, normal, voxel)) continue;
    one_plane = one_plane && !facet->suspect && (plane == nullptr || in_one_plane(facet->facet, normal, plane->facet));
    plane = facet;
    if (!one_plane) break;
  }
  if (one_plane) {
    const FacetNormal normal(plane == nullptr ? Triangle{} : plane->facet);
    const std::optional<Fraction> part = plane == nullptr ? Fraction{0, 1} : part_of(normal, plane->facet.a, voxel);
    const auto level = part ? levels_of(*part, near_share.top_level).near(near_share.share, near_share.off) : std::nullopt;
    if (level) return *level;
  }
  return level_by_volume(voxel, near_facets, near_share);
}

PlaneLevels levels_of_height(std::int64_t z, std::int64_t z0, std::int64_t z1, std::uint32_t top_level) {
  return levels_of({z - z0, z1 - z0}, top_level);
}

}  // namespace lamina::coverage
