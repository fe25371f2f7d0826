#include "stages/load/stl_facets.h"

#include <algorithm>
#include <cstring>

namespace lamina::load {
namespace {

constexpr std::size_t kStrip = 256;  // facets whose 2304 coordinates are snapped in one go

/// Snaps `count` (a multiple of 12) finite coordinates in mm within reach, and grows the box by them.
///
/// A float times 1e6 = 2^6 * 15625 has at most 24 + 14 significant bits, so it is exact in double; adding a half to
/// 38 bits is exact too unless the product is below 2^-15, where any rounding ends at 0 anyway. Truncation then gives
/// llround(x * 1e6): to the nearest, halves away from zero.
void snap_strip(const float* __restrict in, Nm* __restrict out, std::size_t count, CoordinateBox& box) {
  for (std::size_t i = 0; i < count; ++i) {
    const double nm = static_cast<double>(in[i]) * 1e6;
    out[i] = static_cast<Nm>(nm + __builtin_copysign(0.5, nm));
  }
  std::array<float, 12> lo = box.lo, hi = box.hi;
  for (std::size_t i = 0; i < count; i += 12) {
    for (std::size_t k = 0; k < 12; ++k) {
      lo[k] = in[i + k] < lo[k] ? in[i + k] : lo[k];
      hi[k] = in[i + k] > hi[k] ? in[i + k] : hi[k];
    }
  }
  box.lo = lo;
  box.hi = hi;
}

/// Whether all coordinates are finite and within reach: NaN, infinity and large numbers are large as bits, too.
bool within_reach(const float* in, std::size_t count) {
  constexpr float kLimit = 2147.4836f;  // the largest float below 2147.483647
  std::int32_t limit = 0;
  std::memcpy(&limit, &kLimit, 4);
  std::int32_t worst = 0;
  for (std::size_t i = 0; i < count; ++i) {
    std::int32_t bits = 0;
    std::memcpy(&bits, in + i, 4);
    bits &= 0x7fffffff;
    worst = bits > worst ? bits : worst;
  }
  return worst <= limit;
}

/// Facets of plain millimetres. False if one of them cannot be snapped.
bool snap_plain(const char* facets, std::size_t count, Triangle* out, CoordinateBox& box) {
  std::array<float, kStrip * 9 + 12> corner;
  for (std::size_t first = 0; first < count; first += kStrip) {
    const std::size_t strip = std::min(kStrip, count - first);
    for (std::size_t i = 0; i < strip; ++i) std::memcpy(corner.data() + 9 * i, facets + (first + i) * kFacetBytes + 12, 36);
    std::size_t numbers = 9 * strip;
    if (!within_reach(corner.data(), numbers)) return false;
    if (strip == kStrip) {
      snap_strip(corner.data(), &out[first].a.x, numbers, box);
    } else {
      // The last strip is filled up with corners that it has already, which change no bound.
      for (; numbers % 12 != 0; ++numbers) corner[numbers] = corner[numbers - 3];
      std::array<Nm, kStrip * 9 + 12> snapped;
      snap_strip(corner.data(), snapped.data(), numbers, box);
      std::memcpy(&out[first].a.x, snapped.data(), 36 * strip);
    }
  }
  return true;
}

bool snap_transformed(const char* facets, std::size_t count, const Snapper& snapper, Triangle* out, Box& box) {
  for (std::size_t i = 0; i < count; ++i) {
    if (snap_facet(facets + i * kFacetBytes, snapper, out[i]) != Snapped::kYes) return false;
    box.add(out[i].a);
    box.add(out[i].b);
    box.add(out[i].c);
  }
  return true;
}

/// The bounds of a file in plain millimetres, in nm.
Box snapped_box(const CoordinateBox& from, const Snapper& snapper) {
  Box box;
  for (std::size_t k = 0; k < 12; k += 3) {
    Point3 lo{}, hi{};
    if (from.lo[k] > from.hi[k]) continue;
    snapper.snap(static_cast<double>(from.lo[k]), static_cast<double>(from.lo[k + 1]), static_cast<double>(from.lo[k + 2]), lo);
    snapper.snap(static_cast<double>(from.hi[k]), static_cast<double>(from.hi[k + 1]), static_cast<double>(from.hi[k + 2]), hi);
    box.add(lo);
    box.add(hi);
  }
  return box;
}

}  // namespace

void FacetBox::add(const FacetBox& other) {
  for (std::size_t k = 0; k < 12; ++k) {
    plain.lo[k] = std::min(plain.lo[k], other.plain.lo[k]);
    plain.hi[k] = std::max(plain.hi[k], other.plain.hi[k]);
  }
  transformed.add(other.transformed);
}

Box FacetBox::nm(const Snapper& snapper) const { return is_plain(snapper) ? snapped_box(plain, snapper) : transformed; }

Snapped snap_facet(const char* facet, const Snapper& snapper, Triangle& out) {
  std::array<float, 9> corner;
  std::memcpy(corner.data(), facet + 12, 36);
  Triangle triangle{};
  const std::array<Point3*, 3> points =
      snapper.mirrors() ? std::array{&triangle.a, &triangle.c, &triangle.b} : std::array{&triangle.a, &triangle.b, &triangle.c};
  for (std::size_t i = 0; i < 3; ++i) {
    const Snapped snapped = snapper.snap(static_cast<double>(corner[3 * i]), static_cast<double>(corner[3 * i + 1]),
                                         static_cast<double>(corner[3 * i + 2]), *points[i]);
    if (snapped != Snapped::kYes) return snapped;
  }
  out = triangle;
  return Snapped::kYes;
}

bool snap_facets(const char* facets, std::size_t count, const Snapper& snapper, Triangle* out, FacetBox& box) {
  return is_plain(snapper) ? snap_plain(facets, count, out, box.plain)
                           : snap_transformed(facets, count, snapper, out, box.transformed);
}

}  // namespace lamina::load
