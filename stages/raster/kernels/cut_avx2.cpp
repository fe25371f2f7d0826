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

/// What turns eight facets of a cluster: which of them have corner 1 or 2 as tip, and the order that closes gaps.
struct Turn {
  __m256i tip_is_1, tip_is_2, order;
};

/// One coordinate of tip, left and right.
LAMINA_INLINE void put_turned(const Turn& turn, __m256i a, __m256i b, __m256i c, __m256i offset, Nm* tip, Nm* left, Nm* right) {
  const auto put = [&](__m256i if_0, __m256i if_1, __m256i if_2, Nm* at) LAMINA_AVX2 {
    const __m256i turned = _mm256_blendv_epi8(_mm256_blendv_epi8(if_0, if_1, turn.tip_is_1), if_2, turn.tip_is_2);
    store(at, _mm256_add_epi32(_mm256_permutevar8x32_epi32(turned, turn.order), offset));
  };
  put(a, b, c, tip);
  put(b, c, a, left);
  put(c, a, b, right);
}

/// Eight points, coordinate by coordinate.
struct Points {
  __m256i x, y, z;
};

/// Corner k of eight facets: four loads for each half of the registers, which are then turned from rows into columns. A gather
/// of each coordinate would be three loads a corner.
LAMINA_INLINE Points corners_at(const Nm* const* table, const std::uint32_t* corner) {
  const auto two = [&](std::uint32_t i) LAMINA_AVX2 {
    return _mm256_inserti128_si256(_mm256_castsi128_si256(four(table[i] + corner[i])), four(table[i + 4] + corner[i + 4]), 1);
  };
  const __m256i a = two(0), b = two(1), c = two(2), d = two(3);
  const __m256i xy_ab = _mm256_unpacklo_epi32(a, b), xy_cd = _mm256_unpacklo_epi32(c, d);
  const __m256i z_ab = _mm256_unpackhi_epi32(a, b), z_cd = _mm256_unpackhi_epi32(c, d);
  return {_mm256_unpacklo_epi64(xy_ab, xy_cd), _mm256_unpackhi_epi64(xy_ab, xy_cd), _mm256_unpacklo_epi64(z_ab, z_cd)};
}

/// To the nearest double, as the processor rounds a single whole number: both halves are exact, their sum rounds once.
LAMINA_INLINE __m256d doubles(__m256i whole) {
  const __m256i low = _mm256_blend_epi32(whole, _mm256_set1_epi64x(0x4330000000000000), 0xAA);  // 2^52 + low half
  const __m256i high = _mm256_xor_si256(_mm256_srli_epi64(whole, 32),
                                        _mm256_set1_epi64x(0x4530000080000000));     // 2^84 + 2^63 + 2^32 high half
  const __m256d rest = _mm256_castsi256_pd(_mm256_set1_epi64x(0x4530000080100000));  // 2^84 + 2^63 + 2^52
  return _mm256_add_pd(_mm256_sub_pd(_mm256_castsi256_pd(high), rest), _mm256_castsi256_pd(low));
}

/// The rows of four ends at y, which lie on the edges from the tips to `other`.
LAMINA_INLINE __m128i rows_of_ends(const PixelSampling& sampling, const CutFacets& facets, const CutFacets::Corner& other,
                                   std::uint32_t i, int live, Nm plane, __m256d y) {
  const __m256d guess =
      _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(y, _mm256_set1_pd(sampling.rows_per_nm)), _mm256_set1_pd(0.5)),
                    _mm256_set1_pd(sampling.near_y));
  const __m128i row = _mm256_cvttpd_epi32(guess);
  const __m256d beyond = _mm256_sub_pd(guess, _mm256_cvtepi32_pd(row));
  const int near = live & _mm256_movemask_pd(_mm256_cmp_pd(beyond, _mm256_set1_pd(2 * sampling.near_y), _CMP_LT_OQ));
  if (near == 0) [[likely]]
    return row;
  alignas(16) std::uint32_t rows[4];
  _mm_store_si128(reinterpret_cast<__m128i*>(rows), row);
  for (std::uint32_t k = 0; k < 4; ++k) {
    if ((near >> k & 1) != 0) rows[k] = exact_end(sampling, facets, other, i + k, plane);
  }
  return _mm_load_si128(reinterpret_cast<const __m128i*>(rows));
}

/// Where four edges from the tips meet the plane, 0 to 1 and in y.
struct Meeting {
  __m256d share, y;
};
LAMINA_INLINE Meeting meet(__m256d up, __m128i edge_z, __m128i tip_y, __m128i edge_y) {
  const __m256d share = _mm256_div_pd(up, _mm256_cvtepi32_pd(edge_z));
  return {share, _mm256_add_pd(_mm256_cvtepi32_pd(tip_y), _mm256_mul_pd(share, _mm256_cvtepi32_pd(edge_y)))};
}

/// Four products of two whole numbers of 32 bits, less four others.
LAMINA_INLINE __m256i less(__m128i a, __m128i b, __m128i c, __m128i d) {
  return _mm256_sub_epi64(_mm256_mul_epi32(_mm256_cvtepi32_epi64(a), _mm256_cvtepi32_epi64(b)),
                          _mm256_mul_epi32(_mm256_cvtepi32_epi64(c), _mm256_cvtepi32_epi64(d)));
}

LAMINA_INLINE __m256i flag(__m256i where, std::uint32_t bit) {
  return _mm256_and_si256(where, _mm256_set1_epi64x(static_cast<long long>(std::uint64_t{bit} << 32)));
}

}  // namespace

void find(const IndexedSource& source, FoundFacets& found) {
  const IndexedCluster& cluster = *source.cluster;
  const __m128i up = _mm_sub_epi8(_mm_set1_epi8(static_cast<char>(source.step)), four(cluster.steps.low));
  const __m128i met = _mm_cmpeq_epi8(_mm_subs_epu8(up, four(cluster.steps.span)), _mm_setzero_si128());
  const auto lanes = static_cast<unsigned>(_mm_movemask_epi8(met));
  const __m256i table = _mm256_set1_epi64x(reinterpret_cast<long long>(source.vertex));
  std::uint32_t n = found.size;
  for (std::uint32_t first = 0; first < kClusterSize; first += 8) {
    const unsigned of_eight = lanes >> first & 255;
    const __m256i order = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kLanesOfEight[of_eight])));
    for (std::uint32_t k = 0; k < 3; ++k) {
      const __m256i number = _mm256_permutevar8x32_epi32(_mm256_cvtepu16_epi32(four(cluster.corner[k] + first)), order);
      store(found.corner[k] + n, _mm256_add_epi32(number, _mm256_add_epi32(number, number)));
    }
    store(found.facet + n, _mm256_add_epi32(order, _mm256_set1_epi32(static_cast<int>(source.first_facet + first))));
    store(found.table + n, table);
    store(found.table + n + 4, table);
    n += static_cast<std::uint32_t>(std::popcount(of_eight));
  }
  found.size = n;
}

void gather(FoundFacets& found, std::uint32_t instance, const Point3& offset, Nm plane, CutFacets& facets) {
  const __m256i z = _mm256_set1_epi32(plane_in_mesh(plane, offset)), ones = _mm256_set1_epi32(-1);
  for (auto& corner : found.corner) store(corner + found.size, _mm256_setzero_si256());
  std::fill_n(found.table + found.size, 8, found.table[0]);  // whole registers are read
  std::uint32_t n = facets.size;
  for (std::uint32_t i = 0; i < found.size; i += 8) {
    const unsigned live = found.size - i >= 8 ? 255u : (1u << (found.size - i)) - 1;
    const Points p = corners_at(found.table + i, found.corner[0] + i), q = corners_at(found.table + i, found.corner[1] + i),
                 r = corners_at(found.table + i, found.corner[2] + i);
    const __m256i a = _mm256_cmpgt_epi32(p.z, z), b = _mm256_cmpgt_epi32(q.z, z), c = _mm256_cmpgt_epi32(r.z, z);
    const __m256i a_b = _mm256_xor_si256(a, b), a_c = _mm256_xor_si256(a, c);
    const unsigned crossed = live & static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_or_si256(a_b, a_c))));
    const __m256i order = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kLanesOfEight[crossed])));
    const Turn turn{_mm256_andnot_si256(a_c, a_b), _mm256_xor_si256(a_b, ones), order};
    put_turned(turn, p.z, q.z, r.z, _mm256_set1_epi32(offset.z), facets.tip.z + n, facets.left.z + n, facets.right.z + n);
    put_turned(turn, p.y, q.y, r.y, _mm256_set1_epi32(offset.y), facets.tip.y + n, facets.left.y + n, facets.right.y + n);
    put_turned(turn, p.x, q.x, r.x, _mm256_set1_epi32(offset.x), facets.tip.x + n, facets.left.x + n, facets.right.x + n);
    store(facets.facet + n, _mm256_permutevar8x32_epi32(eight(found.facet + i), order));
    store(facets.instance + n, _mm256_set1_epi32(static_cast<int>(instance)));
    n += static_cast<std::uint32_t>(std::popcount(crossed));
  }
  facets.size = n;
  found.size = 0;
}

void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets) {
  const Cluster& cluster = *source.cluster;
  const __m256i z = _mm256_set1_epi32(plane_in_mesh(plane, source.offset));
  const __m256i ones = _mm256_set1_epi32(-1);
  for (std::uint32_t first = 0; first < kClusterSize; first += 8) {
    const __m256i z0 = eight(cluster.z[0] + first), z1 = eight(cluster.z[1] + first), z2 = eight(cluster.z[2] + first);
    const __m256i a = _mm256_cmpgt_epi32(z0, z), b = _mm256_cmpgt_epi32(z1, z), c = _mm256_cmpgt_epi32(z2, z);
    const __m256i a_b = _mm256_xor_si256(a, b), a_c = _mm256_xor_si256(a, c);
    const auto crossed = static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_or_si256(a_b, a_c))));
    if (crossed == 0) continue;
    const __m256i order = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kLanesOfEight[crossed])));
    const Turn turn{_mm256_andnot_si256(a_c, a_b), _mm256_xor_si256(a_b, ones), order};
    const std::uint32_t n = facets.size;
    put_turned(turn, z0, z1, z2, _mm256_set1_epi32(source.offset.z), facets.tip.z + n, facets.left.z + n, facets.right.z + n);
    put_turned(turn, eight(cluster.y[0] + first), eight(cluster.y[1] + first), eight(cluster.y[2] + first),
               _mm256_set1_epi32(source.offset.y), facets.tip.y + n, facets.left.y + n, facets.right.y + n);
    put_turned(turn, eight(cluster.x[0] + first), eight(cluster.x[1] + first), eight(cluster.x[2] + first),
               _mm256_set1_epi32(source.offset.x), facets.tip.x + n, facets.left.x + n, facets.right.x + n);
    store(facets.facet + n, _mm256_add_epi32(order, _mm256_set1_epi32(static_cast<int>(source.first_facet + first))));
    store(facets.instance + n, _mm256_set1_epi32(static_cast<int>(source.instance)));
    facets.size = n + static_cast<std::uint32_t>(std::popcount(crossed));
  }
}

void cut(const PixelSampling& sampling, CutFacets& facets, Nm plane, std::uint32_t row_begin, std::uint32_t row_end,
         Segments& out) {
  out.make_room(facets.size + 4);  // four are written, whatever counts
  std::size_t to = out.size;
  const __m256d columns_per_nm = _mm256_set1_pd(sampling.columns_per_nm);
  for (std::uint32_t i = 0; i < facets.size; i += 4) {
    const int live = facets.size - i >= 4 ? 15 : (1 << (facets.size - i)) - 1;
    const __m128i tip_x = four(facets.tip.x + i), tip_y = four(facets.tip.y + i), tip_z = four(facets.tip.z + i);
    const __m128i ux = _mm_sub_epi32(four(facets.left.x + i), tip_x), uy = _mm_sub_epi32(four(facets.left.y + i), tip_y),
                  uz = _mm_sub_epi32(four(facets.left.z + i), tip_z), vx = _mm_sub_epi32(four(facets.right.x + i), tip_x),
                  vy = _mm_sub_epi32(four(facets.right.y + i), tip_y), vz = _mm_sub_epi32(four(facets.right.z + i), tip_z);
    const __m256d up = _mm256_cvtepi32_pd(_mm_sub_epi32(_mm_set1_epi32(plane), tip_z));
    const Meeting left = meet(up, uz, tip_y, uy), right = meet(up, vz, tip_y, vy);
    const __m128i row = rows_of_ends(sampling, facets, facets.left, i, live, plane, left.y);
    const __m128i other_row = rows_of_ends(sampling, facets, facets.right, i, live, plane, right.y);
    const __m128i first = _mm_max_epi32(_mm_min_epi32(row, other_row), _mm_set1_epi32(static_cast<int>(row_begin)));
    const __m128i last = _mm_min_epi32(_mm_max_epi32(row, other_row), _mm_set1_epi32(static_cast<int>(row_end)));
    const auto valid = static_cast<unsigned>(live & _mm_movemask_ps(_mm_castsi128_ps(_mm_cmplt_epi32(first, last))));

    const __m256i nx = less(uy, vz, uz, vy), ny = less(uz, vx, ux, vz);
    const __m256d slope = _mm256_div_pd(_mm256_xor_pd(doubles(ny), _mm256_set1_pd(-0.0)), doubles(nx));
    const __m256d x = _mm256_sub_pd(_mm256_add_pd(_mm256_cvtepi32_pd(tip_x), _mm256_mul_pd(left.share, _mm256_cvtepi32_pd(ux))),
                                    _mm256_mul_pd(slope, left.y));
    const __m256d column =
        _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, columns_per_nm), _mm256_set1_pd(0.5)), _mm256_set1_pd(sampling.near_x));
    const __m256d flat = _mm256_cmp_pd(_mm256_andnot_pd(_mm256_set1_pd(-0.0), slope), _mm256_set1_pd(kSteepest), _CMP_NLE_UQ);

    // One word a segment: its first row in the low half, count and flags in the high half.
    const __m256i zero = _mm256_setzero_si256();
    const __m256i count = _mm256_slli_epi64(_mm256_cvtepu32_epi64(_mm_sub_epi32(last, first)), 32 + SegmentRows::kFlagBits);
    const __m256i flags = _mm256_or_si256(flag(_mm256_cmpgt_epi64(zero, nx), SegmentRows::kEnters),
                                          _mm256_or_si256(flag(_mm256_cmpeq_epi64(ny, zero), SegmentRows::kUpright),
                                                          flag(_mm256_castpd_si256(flat), SegmentRows::kExact)));
    const __m256i rows = _mm256_or_si256(_mm256_or_si256(_mm256_cvtepu32_epi64(first), count), flags);
    const __m256i origin = _mm256_or_si256(_mm256_cvtepu32_epi64(four(facets.facet + i)),
                                           _mm256_slli_epi64(_mm256_cvtepu32_epi64(four(facets.instance + i)), 32));
    const __m256i order = eight(kLanesOfFour[valid].data());
    store(out.column.data() + to, _mm256_permutevar8x32_epi32(_mm256_castpd_si256(column), order));
    store(out.columns_per_nm.data() + to,
          _mm256_permutevar8x32_epi32(_mm256_castpd_si256(_mm256_mul_pd(slope, columns_per_nm)), order));
    store(out.rows.data() + to, _mm256_permutevar8x32_epi32(rows, order));
    store(out.origin.data() + to, _mm256_permutevar8x32_epi32(origin, order));
    to += static_cast<std::size_t>(std::popcount(valid));
  }
  out.size = to;
  facets.size = 0;
}

}  // namespace lamina::raster::avx2

#undef LAMINA_INLINE
#endif
