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

Above corners_above(const Cluster& cluster, Nm z) {  // of what counts as in the plane
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

/// height_for_plane(), without a branch.
Nm counted(Nm z, const PlaneInMesh& plane) { return z > plane.reach ? z : std::min(z, plane.z); }

/// That of a facet which the plane does not cut may not fit into 32 bits; it is not used.
Nm less(Nm a, Nm b) { return static_cast<Nm>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b)); }

/// What floating point says of all facets: the rows that their ends begin, and the lines through both.
struct Ends {
  std::int32_t left[CutFacets::kCapacity], right[CutFacets::kCapacity];
  double x[CutFacets::kCapacity], slope[CutFacets::kCapacity];  // nm, where y = 0
};

/// Loops so simple that compilers do two facets at once. An end near a whole number is decided in integers.
void find_ends(const PixelSampling& sampling, const CutFacets& facets, Ends& ends) {
  const std::uint32_t size = facets.size;
  const double rows_per_nm = sampling.rows_per_nm, near = sampling.near_y;
  const auto& of = facets.number;
  double row[CutFacets::kCapacity], other_row[CutFacets::kCapacity];  // + 1 + near; no end lies before the bed
  for (std::uint32_t i = 0; i < size; ++i) {
    const double left_z = of[CutFacets::kLeftZ][i], right_z = of[CutFacets::kRightZ][i];
    const double share = of[CutFacets::kUp][i] / (left_z * right_z);
    const double to_left = share * right_z, to_right = share * left_z;
    const double left_y = to_left * of[CutFacets::kLeftY][i], right_y = to_right * of[CutFacets::kRightY][i];
    const double left_x = to_left * of[CutFacets::kLeftX][i], right_x = to_right * of[CutFacets::kRightX][i];
    const double slope = (right_x - left_x) / (right_y - left_y);
    const double tip_y = of[CutFacets::kTipY][i], y = tip_y + left_y;
    ends.x[i] = (of[CutFacets::kTipX][i] + left_x) - slope * y;
    ends.slope[i] = slope;
    row[i] = y * rows_per_nm + (0.5 + near);
    other_row[i] = (tip_y + right_y) * rows_per_nm + (0.5 + near);
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
  const auto exact = [&](std::uint32_t i, std::uint32_t edge_x) {
    return static_cast<std::int32_t>(
        exact_end(sampling, of[CutFacets::kTipY][i], of[CutFacets::kUp][i], of[edge_x + 1][i], of[edge_x + 2][i]));
  };
  for (std::uint32_t i = 0; i < size; ++i) {
    if (row[i] < 2 * near) ends.left[i] = exact(i, CutFacets::kLeftX);
    if (other_row[i] < 2 * near) ends.right[i] = exact(i, CutFacets::kRightX);
  }
}

}  // namespace

std::size_t find(const IndexedSource& source, std::span<const ClusterVisit> visits, FoundFacets& found) {
  const std::int32_t first = found.first_of(source.vertex);
  std::uint32_t i = found.size;
  std::size_t taken = 0;
  for (; taken < visits.size() && i <= FoundFacets::kCapacity - kClusterSize; ++taken) {
    const IndexedCluster& cluster = source.at(visits[taken]);
    const std::uint32_t before = i;
    for (std::uint32_t lanes = facets_met(cluster.steps, source.step); lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
      for (std::uint32_t k = 0; k < 3; ++k) found.corner[k][i] = first + 3 * std::int32_t{cluster.corner[k][lane]};
      found.facet[i] = visits[taken].cluster * kClusterSize + lane;
      ++i;
    }
    fetch_early(source, visits, taken, found, before);
  }
  found.size = i;
  return taken;
}

void cut_found(const CutTask& task, std::uint32_t instance, const Point3& offset, FoundFacets& found) {
  CutFacets facets;
  const PlaneInMesh plane = plane_in_mesh(task.plane, offset);
  const Nm z = plane.z, reach = plane.reach, offset_x = offset.x, offset_y = offset.y;
  auto& of = facets.number;
  std::uint32_t to = 0;
  for (std::uint32_t i = 0; i < found.size; ++i) {
    const Nm *const a = found.base + found.corner[0][i], *const b = found.base + found.corner[1][i],
                    *const c = found.base + found.corner[2][i];
    const Nm* const corner[] = {a, b, c, a, b};
    const bool a_b = (a[2] > reach) != (b[2] > reach), a_c = (a[2] > reach) != (c[2] > reach);
    const Nm a_z = counted(a[2], plane), b_z = counted(b[2], plane), c_z = counted(c[2], plane);
    const Nm height[] = {a_z, b_z, c_z, a_z, b_z};
    const unsigned turn = a_b ? (a_c ? 0 : 1) : 2;
    const Nm *const tip = corner[turn], *const left = corner[turn + 1], *const right = corner[turn + 2];
    facets.facet[to] = found.facet[i];
    facets.instance[to] = instance;
    of[CutFacets::kTipX][to] = tip[0] + offset_x;
    of[CutFacets::kTipY][to] = tip[1] + offset_y;
    of[CutFacets::kUp][to] = less(z, height[turn]);
    of[CutFacets::kLeftZ][to] = less(height[turn + 1], height[turn]);
    of[CutFacets::kRightZ][to] = less(height[turn + 2], height[turn]);
    for (std::uint32_t k = 0; k < 2; ++k) {
      of[CutFacets::kLeftX + k][to] = less(left[k], tip[k]);
      of[CutFacets::kRightX + k][to] = less(right[k], tip[k]);
    }
    to += a_b || a_c ? 1 : 0;  // no processor foresees it, so all are written and those that are not cut written over
  }
  facets.size = to;
  cut(task, facets);
  found.size = 0;
}

void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets) {
  const Cluster& cluster = *source.cluster;
  const PlaneInMesh in_mesh = plane_in_mesh(plane, source.offset);
  const Nm offset_x = source.offset.x, offset_y = source.offset.y;
  const Above above = corners_above(cluster, in_mesh.reach);
  const auto* const coordinates = reinterpret_cast<const Nm*>(&cluster);  // three of z, three of y, three of x
  const std::uint32_t tip_is_1 = above.tip_is_1(), tip_is_2 = above.tip_is_2();
  auto& of = facets.number;
  std::uint32_t i = facets.size;
  for (std::uint32_t lanes = above.crossed(); lanes != 0; lanes &= lanes - 1) {
    const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
    facets.facet[i] = source.first_facet + lane;
    facets.instance[i] = source.instance;
    const std::uint32_t turn = (tip_is_1 >> lane & 1) | (tip_is_2 >> lane & 1) << 1;
    const auto corner = [&](std::uint32_t k) { return coordinates + k * kClusterSize + lane; };
    const Nm *const tip = corner(turn), *const left = corner(kNextCorner[turn]), *const right = corner(kNextCorner[turn + 1]);
    constexpr std::uint32_t kX = 6 * kClusterSize, kY = 3 * kClusterSize;  // behind z
    of[CutFacets::kTipX][i] = tip[kX] + offset_x;
    of[CutFacets::kTipY][i] = tip[kY] + offset_y;
    const Nm height = counted(tip[0], in_mesh);
    of[CutFacets::kUp][i] = in_mesh.z - height;
    of[CutFacets::kLeftX][i] = left[kX] - tip[kX];
    of[CutFacets::kLeftY][i] = left[kY] - tip[kY];
    of[CutFacets::kLeftZ][i] = counted(left[0], in_mesh) - height;
    of[CutFacets::kRightX][i] = right[kX] - tip[kX];
    of[CutFacets::kRightY][i] = right[kY] - tip[kY];
    of[CutFacets::kRightZ][i] = counted(right[0], in_mesh) - height;
    ++i;
  }
  facets.size = i;
}

void cut(const CutTask& task, CutFacets& facets) {
  Segments& out = task.out;
  out.ensure_capacity(facets.size + 1);  // one more is written and not counted
  Ends ends;
  find_ends(task.sampling, facets, ends);
  double* const column = out.column.data();
  double* const columns_per_nm = out.columns_per_nm.data();
  SegmentRows* const rows = out.rows.data();
  SegmentOrigin* const origin = out.origin.data();
  const double per_nm = task.sampling.columns_per_nm, near = task.sampling.near_x;
  const auto& of = facets.number;
  const auto row_begin = static_cast<std::int32_t>(task.row_begin), row_end = static_cast<std::int32_t>(task.row_end);
  std::size_t to = out.size;
  for (std::uint32_t i = 0; i < facets.size; ++i) {
    const double slope = ends.slope[i];
    const std::int32_t left = ends.left[i], right = ends.right[i];
    column[to] = ends.x[i] * per_nm + (0.5 + near);
    columns_per_nm[to] = slope * per_nm;
    const std::int32_t first = std::max(std::min(left, right), row_begin);
    const std::int32_t last = std::min(std::max(left, right), row_end);
    const bool enters = (left < right) != (of[CutFacets::kLeftZ][i] < 0);
    const bool upright = (of[CutFacets::kLeftX][i] | of[CutFacets::kRightX][i]) == 0;
    const std::uint32_t flags = (enters ? SegmentRows::kEnters : 0) | (upright ? SegmentRows::kUpright : 0) |
                                (std::abs(slope) <= kSteepest ? 0 : SegmentRows::kExact);
    rows[to] = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last - first) << SegmentRows::kFlagBits | flags};
    origin[to] = {facets.facet[i], facets.instance[i]};
    to += first < last ? 1 : 0;
    const auto is_low = [&](std::uint32_t edge) { return std::abs(of[edge][i]) < kLevelEdge; };
    if (is_low(CutFacets::kLeftZ) && is_low(CutFacets::kRightZ)) note_level(task, of[0] + i, 1, facets.instance + i);
  }
  out.size = to;
  facets.size = 0;
}

}  // namespace lamina::raster::plain
