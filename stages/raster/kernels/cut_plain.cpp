// Cutting, for any processor.
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cmath>

#include "stages/raster/kernels/bodies.h"

namespace lamina::raster::plain {
namespace {

/// Which corners of the 16 triangles are above the plane, a bit a triangle.
struct Above {
  std::uint32_t corner[3];
  std::uint32_t crossed() const { return (corner[0] ^ corner[1]) | (corner[1] ^ corner[2]); }
  // Of those that are crossed, whose tip is corner 1 or 2.
  std::uint32_t tip_is_1() const { return (corner[0] ^ corner[1]) & ~(corner[0] ^ corner[2]); }
  std::uint32_t tip_is_2() const { return ~(corner[0] ^ corner[1]); }
};

/// The corner behind one.
constexpr std::uint32_t kNextCorner[] = {1, 2, 0, 1};

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

/// Which facets reach the step, a bit a facet.
std::uint32_t facets_met(const FacetSteps& steps, std::uint8_t step) {
#if defined(__SSE2__)
  const auto sixteen = [](const std::uint8_t* bytes) { return _mm_load_si128(reinterpret_cast<const __m128i*>(bytes)); };
  const __m128i up = _mm_sub_epi8(_mm_set1_epi8(static_cast<char>(step)), sixteen(steps.low));
  const __m128i beyond = _mm_subs_epu8(up, sixteen(steps.span));  // stops at zero
  return static_cast<std::uint32_t>(_mm_movemask_epi8(_mm_cmpeq_epi8(beyond, _mm_setzero_si128())));
#else
  std::uint32_t met = 0;
  for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
    met |= static_cast<std::uint32_t>(static_cast<std::uint8_t>(step - steps.low[lane]) <= steps.span[lane]) << lane;
  }
  return met;
#endif
}

/// What floating point says of all facets: where their left edges meet the plane, and the rows that their ends begin.
struct Ends {
  double share[CutFacets::kRoom], y[CutFacets::kRoom];
  std::int32_t left[CutFacets::kRoom], right[CutFacets::kRoom];
};

/// Loops so simple that compilers do two facets at once. An end near a whole number is decided in integers.
void find_ends(const PixelSampling& sampling, const CutFacets& facets, Nm plane, Ends& ends) {
  const std::uint32_t size = facets.size;
  const double rows_per_nm = sampling.rows_per_nm, near = sampling.near_y;
  const CutFacets::Corner &tip = facets.tip, &left = facets.left, &right = facets.right;
  double row[CutFacets::kRoom], other_row[CutFacets::kRoom];  // + 1 + near; no end lies before the bed
  for (std::uint32_t i = 0; i < size; ++i) {
    const double up = plane - tip.z[i], tip_y = tip.y[i];
    const double to_left = up / (left.z[i] - tip.z[i]), to_right = up / (right.z[i] - tip.z[i]);
    const double y = tip_y + to_left * (left.y[i] - tip.y[i]), other_y = tip_y + to_right * (right.y[i] - tip.y[i]);
    ends.share[i] = to_left;
    ends.y[i] = y;
    row[i] = y * rows_per_nm + 0.5 + near;
    other_row[i] = other_y * rows_per_nm + 0.5 + near;
  }
  for (std::uint32_t i = 0; i < size; ++i) {
    ends.left[i] = static_cast<std::int32_t>(row[i]);
    ends.right[i] = static_cast<std::int32_t>(other_row[i]);
    row[i] -= ends.left[i];
    other_row[i] -= ends.right[i];
  }
  bool any = false;
  for (std::uint32_t i = 0; i < size; ++i) any |= (row[i] < 2 * near) | (other_row[i] < 2 * near);
  if (!any) return;
  for (std::uint32_t i = 0; i < size; ++i) {
    if (row[i] < 2 * near) ends.left[i] = static_cast<std::int32_t>(exact_end(sampling, facets, left, i, plane));
    if (other_row[i] < 2 * near) ends.right[i] = static_cast<std::int32_t>(exact_end(sampling, facets, right, i, plane));
  }
}

}  // namespace

void find(const IndexedSource& source, FoundFacets& found) {
  const IndexedCluster& cluster = *source.cluster;
  std::uint32_t i = found.size;
  for (std::uint32_t lanes = facets_met(cluster.steps, source.step); lanes != 0; lanes &= lanes - 1) {
    const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
    found.table[i] = &source.vertex->x;
    for (std::uint32_t k = 0; k < 3; ++k) found.corner[k][i] = 3u * cluster.corner[k][lane];
    found.facet[i] = source.first_facet + lane;
    ++i;
  }
  found.size = i;
}

void gather(FoundFacets& found, std::uint32_t instance, const Point3& offset, Nm plane, CutFacets& facets) {
  const Nm z = plane_in_mesh(plane, offset), offset_x = offset.x, offset_y = offset.y, offset_z = offset.z;
  const auto put = [&](CutFacets::Corner& corner, std::uint32_t i, const Nm* xyz) {
    corner.x[i] = xyz[0] + offset_x;
    corner.y[i] = xyz[1] + offset_y;
    corner.z[i] = xyz[2] + offset_z;
  };
  std::uint32_t to = facets.size;
  for (std::uint32_t i = 0; i < found.size; ++i) {
    const Nm* const table = found.table[i];
    const Nm *const a = table + found.corner[0][i], *const b = table + found.corner[1][i],
                    *const c = table + found.corner[2][i];
    const Nm* const corner[] = {a, b, c, a, b};
    const bool a_b = (a[2] > z) != (b[2] > z), a_c = (a[2] > z) != (c[2] > z);
    const unsigned tip = a_b ? (a_c ? 0 : 1) : 2;
    facets.facet[to] = found.facet[i];
    facets.instance[to] = instance;
    put(facets.tip, to, corner[tip]);
    put(facets.left, to, corner[tip + 1]);
    put(facets.right, to, corner[tip + 2]);
    to += a_b || a_c ? 1 : 0;  // no processor foresees it, so all are written and those that are not cut written over
  }
  facets.size = to;
  found.size = 0;
}

void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets) {
  const Cluster& cluster = *source.cluster;
  const Above above = corners_above(cluster, plane_in_mesh(plane, source.offset));
  const auto* const coordinates = reinterpret_cast<const Nm*>(&cluster);  // three of z, three of y, three of x
  const std::uint32_t tip_is_1 = above.tip_is_1(), tip_is_2 = above.tip_is_2();
  const Nm offset_x = source.offset.x, offset_y = source.offset.y, offset_z = source.offset.z;
  const auto put = [&](CutFacets::Corner& corner, std::uint32_t i, std::uint32_t k, std::uint32_t lane) {
    const Nm* const z = coordinates + k * kClusterSize + lane;
    corner.z[i] = z[0] + offset_z;
    corner.y[i] = z[3 * kClusterSize] + offset_y;
    corner.x[i] = z[6 * kClusterSize] + offset_x;
  };
  std::uint32_t i = facets.size;
  for (std::uint32_t lanes = above.crossed(); lanes != 0; lanes &= lanes - 1) {
    const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
    facets.facet[i] = source.first_facet + lane;
    facets.instance[i] = source.instance;
    const std::uint32_t tip = (tip_is_1 >> lane & 1) | (tip_is_2 >> lane & 1) << 1;
    put(facets.tip, i, tip, lane);
    put(facets.left, i, kNextCorner[tip], lane);
    put(facets.right, i, kNextCorner[tip + 1], lane);
    ++i;
  }
  facets.size = i;
}

void cut(const PixelSampling& sampling, CutFacets& facets, Nm plane, std::uint32_t row_begin, std::uint32_t row_end,
         Segments& out) {
  out.make_room(facets.size + 1);  // one more is written and not counted
  Ends ends;
  find_ends(sampling, facets, plane, ends);
  double* const column = out.column.data();
  double* const columns_per_nm = out.columns_per_nm.data();
  SegmentRows* const rows = out.rows.data();
  SegmentOrigin* const origin = out.origin.data();
  const double per_nm = sampling.columns_per_nm, near = sampling.near_x;
  std::size_t to = out.size;
  for (std::uint32_t i = 0; i < facets.size; ++i) {
    const Point3 tip = facets.tip.at(i), left = facets.left.at(i), right = facets.right.at(i);
    const ExactTriangle triangle(tip, left, right);
    const double slope = -static_cast<double>(triangle.ny) / static_cast<double>(triangle.nx);
    const double x = (tip.x + ends.share[i] * (left.x - tip.x)) - slope * ends.y[i];
    column[to] = x * per_nm + 0.5 + near;
    columns_per_nm[to] = slope * per_nm;
    const std::int32_t first = std::max(std::min(ends.left[i], ends.right[i]), static_cast<std::int32_t>(row_begin));
    const std::int32_t last = std::min(std::max(ends.left[i], ends.right[i]), static_cast<std::int32_t>(row_end));
    const std::uint32_t flags = (triangle.nx < 0 ? SegmentRows::kEnters : 0) | (triangle.ny == 0 ? SegmentRows::kUpright : 0) |
                                (std::abs(slope) <= kSteepest ? 0 : SegmentRows::kExact);
    rows[to] = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last - first) << SegmentRows::kFlagBits | flags};
    origin[to] = {facets.facet[i], facets.instance[i]};
    to += first < last ? 1 : 0;
  }
  out.size = to;
  facets.size = 0;
}

}  // namespace lamina::raster::plain
