#include "stages/coverage/meet/facet_group.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/geometry/targets.h"

namespace lamina::coverage {
namespace {

using Wide = __int128;

template <class Number>
int sign_of(Number value) {
  return (value > 0) - (value < 0);
}

/// Which side of the plane a point is on: 1 in front, 0 in it, -1 behind. Exact.
int side_of(const Plane& plane, const Point3& p) {
  const Point3& a = plane.facet.a;
  const std::int64_t dx = std::int64_t{p.x} - a.x, dy = std::int64_t{p.y} - a.y, dz = std::int64_t{p.z} - a.z;
  const double x = static_cast<double>(plane.nx) * static_cast<double>(dx);
  const double y = static_cast<double>(plane.ny) * static_cast<double>(dy);
  const double z = static_cast<double>(plane.nz) * static_cast<double>(dz);
  if (std::abs(x + y + z) > 1e-14 * (std::abs(x) + std::abs(y) + std::abs(z))) return sign_of(x + y + z);
  return sign_of(static_cast<Wide>(plane.nx) * dx + static_cast<Wide>(plane.ny) * dy + static_cast<Wide>(plane.nz) * dz);
}

struct Flat {
  std::int64_t u, v;
};

/// Projects along the axis on which the plane has the largest area.
Flat detected(const Plane& plane, const Point3& p) {
  const auto x = std::abs(plane.nx), y = std::abs(plane.ny), z = std::abs(plane.nz);
  if (x >= y && x >= z) return {p.y, p.z};
  return y >= z ? Flat{p.z, p.x} : Flat{p.x, p.y};
}

int turn(const Flat& a, const Flat& b, const Flat& c) {
  return sign_of(static_cast<Wide>(b.u - a.u) * (c.v - a.v) - static_cast<Wide>(b.v - a.v) * (c.u - a.u));
}

/// Whether the direction from v to p lies between those to a and b, or on one of them; all in the plane, less than half a turn.
bool between(const Plane& plane, const Point3& v, const Point3& a, const Point3& b, const Point3& p) {
  const Flat o = detected(plane, v), at = detected(plane, p), left = detected(plane, b), right = detected(plane, a);
  const int way = turn(o, right, left);
  const int from_right = turn(o, right, at) * way, to_left = turn(o, at, left) * way;
  if (from_right > 0 && to_left > 0) return true;
  const auto along = [&](const Flat& ray) {
    return static_cast<Wide>(ray.u - o.u) * (at.u - o.u) + static_cast<Wide>(ray.v - o.v) * (at.v - o.v) > 0;
  };
  return (from_right == 0 && along(right)) || (to_left == 0 && along(left));
}

using CornerPointers = std::array<const Point3*, 3>;

CornerPointers corners_of(const Triangle& t) { return {&t.a, &t.b, &t.c}; }

/// Of two facets in one plane.
bool meet_in_plane(const Plane& f, const Plane& g) {
  const auto separated = [&](const Triangle& one, const Triangle& other) {
    const CornerPointers p = corners_of(one), q = corners_of(other);
    const int way = turn(detected(f, one.a), detected(f, one.b), detected(f, one.c));
    for (int i = 0; i < 3; ++i) {
      const Flat from = detected(f, *p[i]), to = detected(f, *p[(i + 1) % 3]);
      if (std::ranges::all_of(q, [&](const Point3* r) { return turn(from, to, detected(f, *r)) * way < 0; })) return true;
    }
    return false;
  };
  return !separated(f.facet, g.facet) && !separated(g.facet, f.facet);
}

struct Arrow {
  double x, y, z;
  double dot(const Arrow& o) const { return x * o.x + y * o.y + z * o.z; }
  double largest() const { return std::max({std::abs(x), std::abs(y), std::abs(z)}); }
};

Arrow arrow(const Point3& from, const Point3& to) {
  return {static_cast<double>(std::int64_t{to.x} - from.x), static_cast<double>(std::int64_t{to.y} - from.y),
          static_cast<double>(std::int64_t{to.z} - from.z)};
}

Arrow normal_of(const Plane& plane) {
  return {static_cast<double>(plane.nx), static_cast<double>(plane.ny), static_cast<double>(plane.nz)};
}

Arrow cross(const Arrow& a, const Arrow& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

/// Whether a plane along an edge of each lies between them, for certain.
bool apart_by_edges(const Triangle& f, const Triangle& g) {
  const CornerPointers p = corners_of(f), q = corners_of(g);
  std::array<Arrow, 3> of_f, of_g;
  double farthest = 0;
  for (int i = 0; i < 3; ++i) {
    of_f[i] = arrow(f.a, *p[i]);
    of_g[i] = arrow(f.a, *q[i]);
    farthest = std::max({farthest, of_f[i].largest(), of_g[i].largest()});
  }
  for (int i = 0; i < 3; ++i) {
    const Arrow e = arrow(*p[i], *p[(i + 1) % 3]);
    for (int k = 0; k < 3; ++k) {
      const Arrow h = arrow(*q[k], *q[(k + 1) % 3]), axis = cross(e, h);
      const double slack = 1e-13 * e.largest() * h.largest() * farthest;
      const auto low = [&](const std::array<Arrow, 3>& all) {
        return std::min({axis.dot(all[0]), axis.dot(all[1]), axis.dot(all[2])});
      };
      const auto high = [&](const std::array<Arrow, 3>& all) {
        return std::max({axis.dot(all[0]), axis.dot(all[1]), axis.dot(all[2])});
      };
      if (low(of_f) - high(of_g) > slack || low(of_g) - high(of_f) > slack) return true;
    }
  }
  return false;
}

/// Facets (v, a, b) and (v, c, d).
bool meet_beyond_corner(const Plane& f, const Plane& g, const Point3& v, const Point3& a, const Point3& b, const Point3& c,
                        const Point3& d) {
  const int side_c = side_of(f, c), side_d = side_of(f, d);
  if (side_c * side_d > 0) return false;
  const int side_a = side_of(g, a), side_b = side_of(g, b);
  if (side_a * side_b > 0) return false;
  if (side_c == 0 && side_d == 0) {
    return between(f, v, a, b, c) || between(f, v, a, b, d) || between(f, v, c, d, a) || between(f, v, c, d, b);
  }
  if (side_c == 0) return between(f, v, a, b, c);
  if (side_d == 0) return between(f, v, a, b, d);
  if (side_a == 0) return between(g, v, c, d, a);
  if (side_b == 0) return between(g, v, c, d, b);
  // Each crosses the other's plane along a ray from v: apart if the rays point in opposite directions, for certain.
  const auto ray = [&](const Plane& plane, const Point3& from, const Point3& to) {
    const Arrow n = normal_of(plane), one = arrow(v, from), other = arrow(v, to);
    const double s = std::abs(n.dot(one)), t = std::abs(n.dot(other));
    return Arrow{(one.x * t + other.x * s) / (s + t), (one.y * t + other.y * s) / (s + t), (one.z * t + other.z * s) / (s + t)};
  };
  const Arrow one = ray(g, a, b), other = ray(f, c, d);
  return !(one.dot(other) < -1e-6 * one.largest() * other.largest());
}

/// Roundings of a plane's value: two of each coordinate of its normal, one of a difference, one of a product, three of sums;
/// each at most 2^-24 of the normal's longest coordinate times the distance.
constexpr float kPlaneMargin = 0x1p-20F;

}  // namespace

Plane::Plane(const Triangle& t) : facet(t) {
  const std::int64_t ux = std::int64_t{t.b.x} - t.a.x, uy = std::int64_t{t.b.y} - t.a.y, uz = std::int64_t{t.b.z} - t.a.z;
  const std::int64_t vx = std::int64_t{t.c.x} - t.a.x, vy = std::int64_t{t.c.y} - t.a.y, vz = std::int64_t{t.c.z} - t.a.z;
  nx = uy * vz - uz * vy;
  ny = uz * vx - ux * vz;
  nz = ux * vy - uy * vx;
}

bool triangles_meet(const Plane& f, const Plane& g, int& shared) {
  const CornerPointers p = corners_of(f.facet), q = corners_of(g.facet);
  shared = 0;
  int own = -1, others = -1, others_left = 3;  // of the shared corners: the last; the one of g that is left over
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      if (*p[i] != *q[k]) continue;
      ++shared;
      own = i, others = k;
      others_left -= k;
    }
  }
  if (shared >= 3 || (shared == 2 && (others_left < 0 || others_left > 2))) return true;  // equal, or without area
  if (shared == 2) {
    if (side_of(f, *q[others_left]) != 0) return false;
    return normal_of(f).dot(normal_of(g)) <= 0;  // folded onto each other
  }
  if (shared == 1) {
    return meet_beyond_corner(f, g, *p[own], *p[(own + 1) % 3], *p[(own + 2) % 3], *q[(others + 1) % 3], *q[(others + 2) % 3]);
  }
  const std::array<int, 3> of_g{side_of(f, *q[0]), side_of(f, *q[1]), side_of(f, *q[2])};
  if (of_g[0] == of_g[1] && of_g[1] == of_g[2]) return of_g[0] == 0 && meet_in_plane(f, g);
  const std::array<int, 3> of_f{side_of(g, *p[0]), side_of(g, *p[1]), side_of(g, *p[2])};
  if (of_f[0] == of_f[1] && of_f[1] == of_f[2]) return false;
  return !apart_by_edges(f.facet, g.facet);
}

BoxLanes::BoxLanes() {
  std::fill_n(&low[0][0], 3 * kGroupSize, INT32_MAX);
  std::fill_n(&high[0][0], 3 * kGroupSize, INT32_MIN);
}

void BoxLanes::set(std::uint32_t lane, const Box& of) {
  low[0][lane] = of.lo.x, low[1][lane] = of.lo.y, low[2][lane] = of.lo.z;
  high[0][lane] = of.hi.x, high[1][lane] = of.hi.y, high[2][lane] = of.hi.z;
}

void FacetGroup::start() {
  used = 0;
  box = BoxLanes();
}

void FacetGroup::add(const Triangle& t, std::uint32_t its_number) {
  const std::uint32_t lane = used++;
  const Point3* const p[3] = {&t.a, &t.b, &t.c};
  Box around;
  for (std::uint32_t k = 0; k < 3; ++k) {
    corner[k][0][lane] = p[k]->x, corner[k][1][lane] = p[k]->y, corner[k][2][lane] = p[k]->z;
    around.add(*p[k]);
  }
  box.set(lane, around);
  number[lane] = its_number;
  const Plane plane(t);
  const Arrow own = normal_of(plane), edge = arrow(t.a, t.b);
  const auto put = [&](std::uint32_t which, const Arrow& n) {
    normal[which][0][lane] = static_cast<float>(n.x);
    normal[which][1][lane] = static_cast<float>(n.y);
    normal[which][2][lane] = static_cast<float>(n.z);
    slack[which][lane] = kPlaneMargin * static_cast<float>(n.largest());
  };
  put(0, own);
  for (std::uint32_t k = 0; k < 3; ++k) put(k + 1, cross(arrow(*p[k], *p[(k + 1) % 3]), own));
  const Arrow of_edge{normal[2][0][lane], normal[2][1][lane], normal[2][2][lane]};
  offset[lane] = static_cast<float>(of_edge.dot(edge));
  reach[lane] = static_cast<float>(std::abs(edge.x) + std::abs(edge.y) + std::abs(edge.z));
}

Triangle FacetGroup::facet(std::uint32_t lane) const {
  const auto point = [&](std::uint32_t k) { return Point3{corner[k][0][lane], corner[k][1][lane], corner[k][2][lane]}; };
  return {point(0), point(1), point(2)};
}

const PairKernels& pair_kernels_for([[maybe_unused]] Isa isa) {
  static constexpr PairKernels kPlain{plain::touching, plain::pairs};
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr PairKernels kAvx2{avx2::touching, avx2::pairs}, kAvx512{avx512::touching, avx512::pairs};
  if (isa == Isa::kAvx512) return kAvx512;
  if (isa == Isa::kAvx2) return kAvx2;
#endif
  return kPlain;
}

}  // namespace lamina::coverage
