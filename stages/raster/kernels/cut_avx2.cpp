// Cutting with AVX2: facets are found eight at a time and cut four at a time.
//
// The bits are those of plain::cut(): corners are moved, and the same operations of IEEE 754 are done in the same order in
// each lane; whole numbers of 64 bits become doubles by one rounding; ends near a whole number go to the same integers.
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#include <array>
#include <bit>

#define LAMINA_INLINE LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::raster::avx2 {
namespace {

/// For each set of eight lanes, their numbers from the lowest on, a byte each.
constexpr auto kLanesOfEight = [] {
  std::array<std::uint64_t, 256> table{};
  for (unsigned set = 0; set < 256; ++set) {
    unsigned count = 0;
    for (std::uint64_t lane = 0; lane < 8; ++lane) {
      if ((set >> lane & 1) != 0) table[set] |= lane << 8 * count++;
    }
  }
  return table;
}();

/// For each set of four lanes of 64 bits, their halves' numbers.
alignas(32) constexpr auto kLanesOfFour = [] {
  std::array<std::array<std::uint32_t, 8>, 16> table{};
  for (std::size_t set = 0; set < 16; ++set) {
    std::size_t count = 0;
    for (std::uint32_t lane = 0; lane < 4; ++lane) {
      if ((set >> lane & 1) == 0) continue;
      table[set][count++] = 2 * lane;
      table[set][count++] = 2 * lane + 1;
    }
  }
  return table;
}();

LAMINA_INLINE __m256i eight(const void* at) { return _mm256_loadu_si256(static_cast<const __m256i*>(at)); }
LAMINA_INLINE void store(void* at, __m256i v) { _mm256_storeu_si256(static_cast<__m256i*>(at), v); }
LAMINA_INLINE __m128i four(const void* at) { return _mm_loadu_si128(static_cast<const __m128i*>(at)); }

/// What turns eight facets: those that the plane crosses, and which of them have corner 1 or 2 as tip.
struct Turns {
  unsigned crossed;
  __m256i tip_is_1, tip_is_2;
  LAMINA_INLINE __m256i tip(__m256i a, __m256i b, __m256i c) const {
    return _mm256_blendv_epi8(_mm256_blendv_epi8(a, b, tip_is_1), c, tip_is_2);
  }
};
LAMINA_INLINE Turns turns_of(__m256i a_z, __m256i b_z, __m256i c_z, __m256i plane) {
  const __m256i a = _mm256_cmpgt_epi32(a_z, plane), b = _mm256_cmpgt_epi32(b_z, plane), c = _mm256_cmpgt_epi32(c_z, plane);
  const __m256i a_b = _mm256_xor_si256(a, b), a_c = _mm256_xor_si256(a, c);
  return {static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_or_si256(a_b, a_c)))),
          _mm256_andnot_si256(a_c, a_b), _mm256_xor_si256(a_b, _mm256_set1_epi32(-1))};
}

/// The plane in the frame of a mesh, and heights as they count for it (height_for_plane()).
struct Planes {
  __m256i z, reach;
  LAMINA_INLINE explicit Planes(const PlaneInMesh& plane)
      : z(_mm256_set1_epi32(plane.z)), reach(_mm256_set1_epi32(plane.reach)) {}
  LAMINA_INLINE __m256i counted(__m256i height) const {
    return _mm256_blendv_epi8(_mm256_min_epi32(height, z), height, _mm256_cmpgt_epi32(height, reach));
  }
};

/// One coordinate of eight facets, turned.
struct Turned {
  __m256i tip, left, right;  // edges from the tip
};
LAMINA_INLINE Turned turned(const Turns& turn, __m256i a, __m256i b, __m256i c) {
  const __m256i tip = turn.tip(a, b, c);
  return {tip, _mm256_sub_epi32(turn.tip(b, c, a), tip), _mm256_sub_epi32(turn.tip(c, a, b), tip)};
}

/// Eight points, coordinate by coordinate.
struct Points {
  __m256i x, y, z;
};

/// Corner k of eight facets: four loads for each half of the registers, which are then turned from rows into columns. A gather
/// of each coordinate would be three loads a corner.
LAMINA_INLINE Points corners_at(const Nm* base, const std::int32_t* corner) {
  const auto two = [&](std::uint32_t i) LAMINA_AVX2 {
    return _mm256_inserti128_si256(_mm256_castsi128_si256(four(base + corner[i])), four(base + corner[i + 4]), 1);
  };
  const __m256i a = two(0), b = two(1), c = two(2), d = two(3);
  const __m256i xy_ab = _mm256_unpacklo_epi32(a, b), xy_cd = _mm256_unpacklo_epi32(c, d);
  const __m256i z_ab = _mm256_unpackhi_epi32(a, b), z_cd = _mm256_unpackhi_epi32(c, d);
  return {_mm256_unpacklo_epi64(xy_ab, xy_cd), _mm256_unpackhi_epi64(xy_ab, xy_cd), _mm256_unpacklo_epi64(z_ab, z_cd)};
}

/// Puts numbers of eight facets (CutFacets::Number) where `put` says.
template <class Put>
LAMINA_INLINE void put_numbers(const Turns& turn, const Points& p, const Points& q, const Points& r,
                               const Planes& plane, const Point3& offset, Put&& put) {
  const Turned z = turned(turn, plane.counted(p.z), plane.counted(q.z), plane.counted(r.z));
  put(CutFacets::kUp, _mm256_sub_epi32(plane.z, z.tip));
  put(CutFacets::kLeftZ, z.left), put(CutFacets::kRightZ, z.right);
  const Turned y = turned(turn, p.y, q.y, r.y);
  put(CutFacets::kTipY, _mm256_add_epi32(y.tip, _mm256_set1_epi32(offset.y)));
  put(CutFacets::kLeftY, y.left), put(CutFacets::kRightY, y.right);
  const Turned x = turned(turn, p.x, q.x, r.x);
  put(CutFacets::kTipX, _mm256_add_epi32(x.tip, _mm256_set1_epi32(offset.x)));
  put(CutFacets::kLeftX, x.left), put(CutFacets::kRightX, x.right);
}

/// What all facets of a task share, and where the next segment goes: kept in registers, since what is written could be anything
/// for all that compilers know.
struct Cutter {
  const CutTask& task;
  double *column, *columns_per_nm;
  SegmentRows* rows;
  SegmentOrigin* origin;
  std::size_t to;
  __m128i row_begin, row_end;
};
LAMINA_INLINE Cutter cutter_for(const CutTask& task) {
  Segments& out = task.out;
  return {task,
          out.column.data(),
          out.columns_per_nm.data(),
          out.rows.data(),
          out.origin.data(),
          out.size,
          _mm_set1_epi32(static_cast<int>(task.row_begin)),
          _mm_set1_epi32(static_cast<int>(task.row_end))};
}

/// The rows of four ends at y, which lie on the edges whose y and z follow `edge_x`.
LAMINA_INLINE __m128i rows_of_ends(const PixelSampling& sampling, const CutFacets& facets, std::uint32_t edge_x,
                                   std::uint32_t i, int live, __m256d y) {
  const __m256d guess =
      _mm256_add_pd(_mm256_mul_pd(y, _mm256_set1_pd(sampling.rows_per_nm)), _mm256_set1_pd(0.5 + sampling.near_y));
  const __m128i row = _mm256_cvttpd_epi32(guess);
  const __m256d beyond = _mm256_sub_pd(guess, _mm256_cvtepi32_pd(row));
  const int near = live & _mm256_movemask_pd(_mm256_cmp_pd(beyond, _mm256_set1_pd(2 * sampling.near_y), _CMP_LT_OQ));
  if (near == 0) [[likely]]
    return row;
  alignas(16) std::uint32_t rows[4];
  _mm_store_si128(reinterpret_cast<__m128i*>(rows), row);
  for (std::uint32_t k = 0; k < 4; ++k) {
    if ((near >> k & 1) == 0) continue;
    const auto number = [&](std::uint32_t which) LAMINA_AVX2 { return facets.number[which][i + k]; };
    rows[k] = exact_end(sampling, number(CutFacets::kTipY), number(CutFacets::kUp), number(edge_x + 1), number(edge_x + 2));
  }
  return _mm_load_si128(reinterpret_cast<const __m128i*>(rows));
}

LAMINA_INLINE __m128i flag(__m128i where, std::uint32_t bit) {
  return _mm_and_si128(where, _mm_set1_epi32(static_cast<int>(bit)));
}
/// Four pairs of numbers.
LAMINA_INLINE __m256i pairs(__m128i first, __m128i second) {
  return _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_unpacklo_epi32(first, second)), _mm_unpackhi_epi32(first, second),
                                 1);
}

/// Appends the segments of the live ones of four facets; the arrays are long enough.
LAMINA_INLINE void cut_four(Cutter& cutter, const CutFacets& facets, std::uint32_t i, int live, __m128i instance) {
  const PixelSampling& sampling = cutter.task.sampling;
  const auto whole = [&](std::uint32_t which) LAMINA_AVX2 { return four(facets.number[which] + i); };
  const auto real = [&](std::uint32_t which) LAMINA_AVX2 { return _mm256_cvtepi32_pd(whole(which)); };
  const __m256d left_z = real(CutFacets::kLeftZ), right_z = real(CutFacets::kRightZ);
  const __m256d share = _mm256_div_pd(real(CutFacets::kUp), _mm256_mul_pd(left_z, right_z));
  const __m256d to_left = _mm256_mul_pd(share, right_z), to_right = _mm256_mul_pd(share, left_z);
  const __m256d left_y = _mm256_mul_pd(to_left, real(CutFacets::kLeftY)),
                right_y = _mm256_mul_pd(to_right, real(CutFacets::kRightY));
  const __m256d left_x = _mm256_mul_pd(to_left, real(CutFacets::kLeftX)),
                right_x = _mm256_mul_pd(to_right, real(CutFacets::kRightX));
  const __m256d slope = _mm256_div_pd(_mm256_sub_pd(right_x, left_x), _mm256_sub_pd(right_y, left_y));
  const __m256d tip_y = real(CutFacets::kTipY), y = _mm256_add_pd(tip_y, left_y);
  const __m256d x = _mm256_sub_pd(_mm256_add_pd(real(CutFacets::kTipX), left_x), _mm256_mul_pd(slope, y));
  const __m256d columns_per_nm = _mm256_set1_pd(sampling.columns_per_nm);
  const __m256d column = _mm256_add_pd(_mm256_mul_pd(x, columns_per_nm), _mm256_set1_pd(0.5 + sampling.near_x));
  const __m256d flat = _mm256_cmp_pd(_mm256_andnot_pd(_mm256_set1_pd(-0.0), slope), _mm256_set1_pd(kSteepest), _CMP_NLE_UQ);

  const __m128i row = rows_of_ends(sampling, facets, CutFacets::kLeftX, i, live, y);
  const __m128i other_row = rows_of_ends(sampling, facets, CutFacets::kRightX, i, live, _mm256_add_pd(tip_y, right_y));
  const __m128i first = _mm_max_epi32(_mm_min_epi32(row, other_row), cutter.row_begin);
  const __m128i last = _mm_min_epi32(_mm_max_epi32(row, other_row), cutter.row_end);
  const auto valid = static_cast<unsigned>(live & _mm_movemask_ps(_mm_castsi128_ps(_mm_cmplt_epi32(first, last))));

  const __m128i rise = _mm_or_si128(_mm_abs_epi32(whole(CutFacets::kLeftZ)), _mm_abs_epi32(whole(CutFacets::kRightZ)));
  const __m128i is_low = _mm_cmplt_epi32(rise, _mm_set1_epi32(kLevelEdge));
  const auto level = static_cast<unsigned>(live & _mm_movemask_ps(_mm_castsi128_ps(is_low)));
  if (level != 0) [[unlikely]] {
    alignas(16) std::uint32_t instances[4];
    _mm_store_si128(reinterpret_cast<__m128i*>(instances), instance);
    note_level(cutter.task, facets.number[0] + i, level, instances);
  }

  const __m128i down = _mm_xor_si128(_mm_sub_epi32(row, other_row), whole(CutFacets::kLeftZ));
  const __m128i edges_x = _mm_or_si128(whole(CutFacets::kLeftX), whole(CutFacets::kRightX));
  const __m128i flat_low = _mm_castps_si128(
      _mm_shuffle_ps(_mm_castpd_ps(_mm256_castpd256_pd128(flat)), _mm_castpd_ps(_mm256_extractf128_pd(flat, 1)), 0x88));
  const __m128i flags = _mm_or_si128(_mm_srli_epi32(down, 31),  // SegmentRows::kEnters
                                     _mm_or_si128(flag(_mm_cmpeq_epi32(edges_x, _mm_setzero_si128()), SegmentRows::kUpright),
                                                  flag(flat_low, SegmentRows::kExact)));
  const __m128i count = _mm_or_si128(_mm_slli_epi32(_mm_sub_epi32(last, first), SegmentRows::kFlagBits), flags);
  const __m256i order = eight(kLanesOfFour[valid].data());
  const auto put = [&](void* at, __m256i v) LAMINA_AVX2 { store(at, _mm256_permutevar8x32_epi32(v, order)); };
  put(cutter.column + cutter.to, _mm256_castpd_si256(column));
  put(cutter.columns_per_nm + cutter.to, _mm256_castpd_si256(_mm256_mul_pd(slope, columns_per_nm)));
  put(cutter.rows + cutter.to, pairs(first, count));
  put(cutter.origin + cutter.to, pairs(four(facets.facet + i), instance));
  cutter.to += static_cast<std::size_t>(std::popcount(valid));
}

}  // namespace

std::size_t find(const IndexedSource& source, std::span<const ClusterVisit> visits, FoundFacets& found) {
  const __m128i step = _mm_set1_epi8(static_cast<char>(source.step));
  const __m256i first = _mm256_set1_epi32(found.first_of(source.vertex));
  std::uint32_t n = found.size;
  std::size_t i = 0;
  for (; i < visits.size() && n <= FoundFacets::kCapacity - kClusterSize; ++i) {
    const IndexedCluster& cluster = source.at(visits[i]);
    const __m128i up = _mm_sub_epi8(step, four(cluster.steps.low));
    const __m128i met = _mm_cmpeq_epi8(_mm_subs_epu8(up, four(cluster.steps.span)), _mm_setzero_si128());
    const auto lanes = static_cast<unsigned>(_mm_movemask_epi8(met));
    const std::uint32_t before = n;
    for (std::uint32_t half = 0; half < kClusterSize; half += 8) {
      const unsigned of_eight = lanes >> half & 255;
      const __m256i order = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kLanesOfEight[of_eight])));
      for (std::uint32_t k = 0; k < 3; ++k) {
        const __m256i number = _mm256_permutevar8x32_epi32(_mm256_cvtepu16_epi32(four(cluster.corner[k] + half)), order);
        const __m256i position = _mm256_madd_epi16(number, _mm256_set1_epi32(3));  // numbers are below 2^15
        store(found.corner[k] + n, _mm256_add_epi32(position, first));
      }
      store(found.facet + n,
            _mm256_add_epi32(order, _mm256_set1_epi32(static_cast<int>(visits[i].cluster * kClusterSize + half))));
      n += static_cast<std::uint32_t>(std::popcount(of_eight));
    }
    fetch_early(source, visits, i, found, before);
  }
  found.size = n;
  return i;
}

void cut_found(const CutTask& task, std::uint32_t instance, const Point3& offset, FoundFacets& found) {
  CutFacets facets;
  std::uint8_t crossed[CutFacets::kCapacity / 8];
  std::uint32_t count = 0;
  for (auto& corner : found.corner) store(corner + found.size, _mm256_setzero_si256());  // whole registers are read
  const Planes planes(plane_in_mesh(task.plane, offset));
  for (std::uint32_t i = 0; i < found.size; i += 8) {
    const unsigned live = found.size - i >= 8 ? 255u : (1u << (found.size - i)) - 1;
    const Points p = corners_at(found.base, found.corner[0] + i), q = corners_at(found.base, found.corner[1] + i),
                 r = corners_at(found.base, found.corner[2] + i);
    const Turns turn = turns_of(p.z, q.z, r.z, planes.reach);
    crossed[i / 8] = static_cast<std::uint8_t>(turn.crossed & live);
    count += static_cast<std::uint32_t>(std::popcount(turn.crossed & live));
    put_numbers(turn, p, q, r, planes, offset,
                [&](std::uint32_t which, __m256i v) LAMINA_AVX2 { store(facets.number[which] + i, v); });
    store(facets.facet + i, eight(found.facet + i));
  }
  task.out.ensure_capacity(count + 4);  // four are written, regardless of how many count
  Cutter cutter = cutter_for(task);
  const __m128i of_instance = _mm_set1_epi32(static_cast<int>(instance));
  for (std::uint32_t i = 0; i < found.size; i += 4) {
    cut_four(cutter, facets, i, crossed[i / 8] >> i % 8 & 15, of_instance);
  }
  task.out.size = cutter.to;
  found.size = 0;
}

void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets) {
  const Cluster& cluster = *source.cluster;
  const Planes planes(plane_in_mesh(plane, source.offset));
  for (std::uint32_t first = 0; first < kClusterSize; first += 8) {
    const auto corner = [&](std::uint32_t k) LAMINA_AVX2 {
      return Points{eight(cluster.x[k] + first), eight(cluster.y[k] + first), eight(cluster.z[k] + first)};
    };
    const Points p = corner(0), q = corner(1), r = corner(2);
    const Turns turn = turns_of(p.z, q.z, r.z, planes.reach);
    if (turn.crossed == 0) continue;
    const std::uint32_t n = facets.size;
    const __m256i order = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kLanesOfEight[turn.crossed])));
    put_numbers(turn, p, q, r, planes, source.offset, [&](std::uint32_t which, __m256i v) LAMINA_AVX2 {
      store(facets.number[which] + n, _mm256_permutevar8x32_epi32(v, order));
    });
    store(facets.facet + n, _mm256_add_epi32(order, _mm256_set1_epi32(static_cast<int>(source.first_facet + first))));
    store(facets.instance + n, _mm256_set1_epi32(static_cast<int>(source.instance)));
    facets.size = n + static_cast<std::uint32_t>(std::popcount(turn.crossed));
  }
}

void cut(const CutTask& task, CutFacets& facets) {
  task.out.ensure_capacity(facets.size + 4);
  Cutter cutter = cutter_for(task);
  for (std::uint32_t i = 0; i < facets.size; i += 4) {
    const int live = facets.size - i >= 4 ? 15 : (1 << (facets.size - i)) - 1;
    cut_four(cutter, facets, i, live, four(facets.instance + i));
  }
  task.out.size = cutter.to;
  facets.size = 0;
}

}  // namespace lamina::raster::avx2

#undef LAMINA_INLINE
#endif
