#include "stages/raster/segment.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <bit>

namespace lamina::raster {
namespace {

using Int128 = __int128;

/// Slopes beyond this are left to integers. Below it the guess is off by less than 0.01 nm: ends are known to 2^-21 nm
/// and the slope to 2^-52 of itself.
constexpr double kSteepest = 4096;

/// Nanometres by which a guess may miss a whole-numbered centre: 1 for the rounding down of centres, the rest spare.
constexpr double kNearNm = 1.5;

/// Point in which an edge meets the plane, in doubles; off by less than 2^-20 nm.
struct EdgePoint {
  double x, y;
};

EdgePoint meet(const Point3& from, const Point3& to, Nm z) {
  const double t_numerator = static_cast<double>(std::int64_t{z} - from.z);
  const double t_denominator = static_cast<double>(std::int64_t{to.z} - from.z);
  const double dx = static_cast<double>(std::int64_t{to.x} - from.x);
  const double dy = static_cast<double>(std::int64_t{to.y} - from.y);
  return {from.x + dx * t_numerator / t_denominator, from.y + dy * t_numerator / t_denominator};
}

/// First row at or beyond an edge's meeting point: guessed, and decided in integers when the guess is near.
std::int64_t first_row(const PixelSampling& sampling, const Point3& from, const Point3& to, Nm z, double y) {
  const double guess = y * sampling.rows_per_nm + 0.5 + sampling.near_y;  // row + 1 + near, and y >= 0
  const auto row = static_cast<std::int64_t>(guess);
  if (guess - static_cast<double>(row) < 2 * sampling.near_y) [[unlikely]] return exact_row(sampling.y, from, to, z);
  return row;
}

}  // namespace

PixelSampling::PixelSampling(const PixelGrid& grid)
    : x(grid.x),
      y(grid.y),
      columns_per_nm(static_cast<double>(grid.x.dpi) / kNmPerInch),
      rows_per_nm(static_cast<double>(grid.y.dpi) / kNmPerInch),
      near_x(kNearNm * columns_per_nm),
      near_y(kNearNm * rows_per_nm),
      row_centre(std::size_t{grid.rows()} + 1) {
  for (std::uint32_t row = 0; row <= grid.rows(); ++row) {
    row_centre[row] = static_cast<Nm>(std::min(y.centre(row), kNmReach));
  }
}

std::int64_t exact_column(const PixelAxis& axis, const ExactTriangle& triangle, Nm y, Nm z) {
  Int128 numerator = Int128{triangle.ny} * (std::int64_t{y} - triangle.a.y) +
                     Int128{triangle.nz} * (std::int64_t{z} - triangle.a.z);
  Int128 denominator = triangle.nx;
  if (denominator < 0) {
    numerator = -numerator;
    denominator = -denominator;
  }
  const auto x = static_cast<std::int64_t>(triangle.a.x + ceil_div(-numerator, denominator));
  return axis.first_at_or_beyond(x);
}

std::int64_t exact_row(const PixelAxis& axis, const Point3& from, const Point3& to, Nm z) {
  std::int64_t numerator = (std::int64_t{to.y} - from.y) * (std::int64_t{z} - from.z);
  std::int64_t denominator = std::int64_t{to.z} - from.z;
  if (denominator < 0) {
    numerator = -numerator;
    denominator = -denominator;
  }
  return axis.first_at_or_beyond(from.y + ceil_div(numerator, denominator));
}

std::uint32_t crossed_lanes(const Cluster& cluster, Nm z) {
#if defined(__SSE2__)
  const __m128i plane = _mm_set1_epi32(z);
  std::uint32_t crossed = 0;
  for (std::uint32_t group = 0; group < kClusterSize / 4; ++group) {
    const auto above = [&](int corner) {
      return _mm_cmpgt_epi32(_mm_load_si128(reinterpret_cast<const __m128i*>(cluster.z[corner]) + group), plane);
    };
    const __m128i a = above(0), b = above(1), c = above(2);
    const __m128i differ = _mm_or_si128(_mm_xor_si128(a, b), _mm_xor_si128(b, c));
    crossed |= static_cast<std::uint32_t>(_mm_movemask_ps(_mm_castsi128_ps(differ))) << (4 * group);
  }
  return crossed;
#else
  std::uint32_t crossed = 0;
  for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
    const bool a = cluster.z[0][lane] > z, b = cluster.z[1][lane] > z, c = cluster.z[2][lane] > z;
    crossed |= static_cast<std::uint32_t>(a != b || b != c) << lane;
  }
  return crossed;
#endif
}

void append_segments(const PixelSampling& sampling, const SegmentSource& source, Nm plane, std::uint32_t row_begin,
                     std::uint32_t row_end, Segments& out) {
  // In the frame of the mesh, where corners lie; a plane out of reach of any corner cuts nothing.
  const auto z = static_cast<Nm>(std::clamp<std::int64_t>(std::int64_t{plane} - source.offset.z, INT32_MIN, INT32_MAX));
  std::uint32_t lanes = crossed_lanes(*source.cluster, z);
  if (lanes == 0) return;
  if (out.capacity() - out.size() < kClusterSize) out.reserve(std::max<std::size_t>(1024, 2 * out.capacity()));

  for (; lanes != 0; lanes &= lanes - 1) {
    const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
    const ExactTriangle triangle(*source.cluster, lane, source.offset);
    // Turn the triangle so that `tip` is alone on its side: the plane cuts the two edges that start there.
    const bool a = triangle.a.z > plane, b = triangle.b.z > plane, c = triangle.c.z > plane;
    const bool tip_is_b = b != a && b != c, tip_is_c = c != a && c != b;
    const Point3& tip = tip_is_b ? triangle.b : tip_is_c ? triangle.c : triangle.a;
    const Point3& left = tip_is_b ? triangle.c : tip_is_c ? triangle.a : triangle.b;
    const Point3& right = tip_is_b ? triangle.a : tip_is_c ? triangle.b : triangle.c;

    const EdgePoint p = meet(tip, left, plane), q = meet(tip, right, plane);
    std::int64_t first = first_row(sampling, tip, left, plane, p.y);
    std::int64_t last = first_row(sampling, tip, right, plane, q.y);
    if (first > last) std::swap(first, last);
    first = std::max<std::int64_t>(first, row_begin);
    last = std::min<std::int64_t>(last, row_end);
    if (first >= last) continue;

    Segment segment;
    segment.first_row = static_cast<std::uint32_t>(first);
    segment.last_row = static_cast<std::uint32_t>(last);
    segment.cluster = source.cluster_index;
    segment.instance = source.instance;
    segment.flags = lane | (triangle.nx < 0 ? Segment::kEnters : 0) | (triangle.ny == 0 ? Segment::kUpright : 0) |
                    (source.cap ? Segment::kCap : 0);
    const double slope = -static_cast<double>(triangle.ny) / static_cast<double>(triangle.nx);
    if (!(std::abs(slope) <= kSteepest)) segment.flags |= Segment::kExact;
    const double x = p.x + slope * (static_cast<double>(sampling.row_centre[segment.first_row]) - p.y);
    segment.column = x * sampling.columns_per_nm + 0.5 + sampling.near_x;
    segment.columns_per_nm = slope * sampling.columns_per_nm;
    out.push_back(segment);
  }
}

}  // namespace lamina::raster
