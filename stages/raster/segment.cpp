#include "stages/raster/segment.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <bit>

namespace lamina::raster {
namespace {

using Int128 = __int128;

/// Slopes beyond this are left to integers. Below it the guess is off by less than 0.01 nm: ends are known to 2^-20 nm,
/// which the slope multiplies, and the slope to 2^-51 of itself, over less than 2^31 nm.
constexpr double kSteepest = 4096;

/// Nanometres by which a guess may miss a whole-numbered centre: 1 for the rounding down of centres, the rest spare.
constexpr double kNearNm = 1.5;

/// How far along an edge it meets the plane, 0 to 1; off by less than 2^-52.
double meeting(const Point3& from, const Point3& to, Nm z) {
  return static_cast<double>(std::int64_t{z} - from.z) / static_cast<double>(std::int64_t{to.z} - from.z);
}

double between(Nm from, Nm to, double share) { return from + share * static_cast<double>(std::int64_t{to} - from); }

/// First row at or beyond an edge's meeting point: guessed, and decided in integers when the guess is near.
std::int64_t first_row(const PixelSampling& sampling, const Point3& from, const Point3& to, Nm z, double y) {
  const double guess = y * sampling.rows_per_nm + 0.5 + sampling.near_y;  // row + 1 + near, and y >= 0
  const auto row = static_cast<std::int64_t>(guess);
  if (guess - static_cast<double>(row) < 2 * sampling.near_y) [[unlikely]]
    return exact_row(sampling.y, from, to, z);
  return row;
}

/// Which corners of the 16 triangles are above the plane, a bit a triangle.
struct Above {
  std::uint32_t corner[3];
  std::uint32_t crossed() const { return (corner[0] ^ corner[1]) | (corner[1] ^ corner[2]); }
};

Above corners_above(const Cluster& cluster, Nm z) {
  Above above{};
#if defined(__SSE2__)
  const __m128i plane = _mm_set1_epi32(z);
  for (std::uint32_t k = 0; k < 3; ++k) {
    const auto* corner = reinterpret_cast<const __m128i*>(cluster.z[k]);
    const auto four = [&](int group) { return _mm_cmpgt_epi32(_mm_load_si128(corner + group), plane); };
    const __m128i bytes = _mm_packs_epi16(_mm_packs_epi32(four(0), four(1)), _mm_packs_epi32(four(2), four(3)));
    above.corner[k] = static_cast<std::uint32_t>(_mm_movemask_epi8(bytes));
  }
#else
  for (std::uint32_t k = 0; k < 3; ++k) {
    for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
      above.corner[k] |= static_cast<std::uint32_t>(cluster.z[k][lane] > z) << lane;
    }
  }
#endif
  return above;
}

}  // namespace

PixelSampling::PixelSampling(const PixelGrid& grid)
    : x(grid.x),
      y(grid.y),
      columns_per_nm(grid.x.pixels_per_nm()),
      rows_per_nm(grid.y.pixels_per_nm()),
      near_x(kNearNm * columns_per_nm),
      near_y(kNearNm * rows_per_nm),
      row_centre(std::size_t{grid.rows()} + 1) {
  for (std::uint32_t row = 0; row <= grid.rows(); ++row) {
    row_centre[row] = static_cast<Nm>(std::min(y.centre(row), kNmReach));
  }
}

std::int64_t exact_column(const PixelAxis& axis, const ExactTriangle& triangle, Nm y, Nm z) {
  Int128 numerator =
      Int128{triangle.ny} * (std::int64_t{y} - triangle.a.y) + Int128{triangle.nz} * (std::int64_t{z} - triangle.a.z);
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

void append_segments(const PixelSampling& sampling, const SegmentSource& source, Nm plane, std::uint32_t row_begin,
                     std::uint32_t row_end, Segments& out) {
  // In the frame of the mesh, where corners lie; a plane out of reach of any corner cuts nothing.
  const auto z = static_cast<Nm>(std::clamp<std::int64_t>(std::int64_t{plane} - source.offset.z, INT32_MIN, INT32_MAX));
  const Cluster& cluster = *source.cluster;
  const Above above = corners_above(cluster, z);
  std::uint32_t lanes = above.crossed();
  if (lanes == 0) return;
  if (out.capacity() - out.size() < kClusterSize) out.reserve(std::max<std::size_t>(1024, 2 * out.capacity()));

  for (; lanes != 0; lanes &= lanes - 1) {
    const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
    // Turn the triangle so that `tip` is alone on its side: the plane cuts the two edges that start there.
    const bool a = (above.corner[0] >> lane & 1) != 0, b = (above.corner[1] >> lane & 1) != 0,
               c = (above.corner[2] >> lane & 1) != 0;
    const std::uint32_t turn = a == b ? 2 : a == c ? 1 : 0;
    const Point3 tip = corner_on_bed(cluster, turn, lane, source.offset);
    const Point3 left = corner_on_bed(cluster, turn == 2 ? 0 : turn + 1, lane, source.offset);
    const Point3 right = corner_on_bed(cluster, turn == 0 ? 2 : turn - 1, lane, source.offset);

    const double to_left = meeting(tip, left, plane);
    const double y = between(tip.y, left.y, to_left);
    std::int64_t first = first_row(sampling, tip, left, plane, y);
    std::int64_t last = first_row(sampling, tip, right, plane, between(tip.y, right.y, meeting(tip, right, plane)));
    if (first > last) std::swap(first, last);
    first = std::max<std::int64_t>(first, row_begin);
    last = std::min<std::int64_t>(last, row_end);
    if (first >= last) continue;

    const ExactTriangle triangle(tip, left, right);
    Segment segment;
    segment.first_row = static_cast<std::uint32_t>(first);
    segment.last_row = static_cast<std::uint32_t>(last);
    segment.cluster = source.cluster_index;
    segment.instance = source.instance;
    segment.flags = lane | (triangle.nx < 0 ? Segment::kEnters : 0) | (triangle.ny == 0 ? Segment::kUpright : 0) |
                    (source.cap ? Segment::kCap : 0);
    const double slope = -static_cast<double>(triangle.ny) / static_cast<double>(triangle.nx);
    if (!(std::abs(slope) <= kSteepest)) segment.flags |= Segment::kExact;
    const double x =
        between(tip.x, left.x, to_left) + slope * (static_cast<double>(sampling.row_centre[segment.first_row]) - y);
    segment.column = x * sampling.columns_per_nm + 0.5 + sampling.near_x;
    segment.columns_per_nm = slope * sampling.columns_per_nm;
    out.push_back(segment);
  }
}

}  // namespace lamina::raster
