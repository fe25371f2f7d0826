// Cutting with AVX-512: facets are found 16 at a time and cut eight at a time.
//
// The bits are those of plain::cut(): corners are moved, and the same operations of IEEE 754 are done in the same order in
// each lane; ends near a whole number go to the same integers.
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#include <bit>

#define LAMINA_INLINE LAMINA_AVX512 __attribute__((always_inline)) inline

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wuninitialized"  // g++ 12 blames its own header
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

namespace lamina::raster::avx512 {
namespace {

LAMINA_INLINE __m256i load8(const void* at) { return _mm256_loadu_si256(static_cast<const __m256i*>(at)); }

/// What turns the facets of a cluster: those that the plane crosses, and which of them have corner 1 or 2 as tip.
struct Turns {
  __mmask16 crossed, tip_is_1, tip_is_2;
};

/// One coordinate of tip, left and right, of the facets that are crossed.
LAMINA_INLINE void put_coordinate(const Turns& turn, __m512i a, __m512i b, __m512i c, Nm offset, Nm* tip, Nm* left, Nm* right) {
  const auto put = [&](__m512i if_0, __m512i if_1, __m512i if_2, Nm* at) LAMINA_AVX512 {
    const __m512i turned = _mm512_mask_mov_epi32(_mm512_mask_mov_epi32(if_0, turn.tip_is_1, if_1), turn.tip_is_2, if_2);
    _mm512_storeu_si512(at, _mm512_add_epi32(_mm512_maskz_compress_epi32(turn.crossed, turned), _mm512_set1_epi32(offset)));
  };
  put(a, b, c, tip);
  put(b, c, a, left);
  put(c, a, b, right);
}
LAMINA_INLINE void put_coordinate(const Turns& turn, const Nm (&corner)[3][kClusterSize], Nm offset, Nm* tip, Nm* left,
                                  Nm* right) {
  put_coordinate(turn, _mm512_loadu_si512(corner[0]), _mm512_loadu_si512(corner[1]), _mm512_loadu_si512(corner[2]), offset, tip,
                 left, right);
}

/// 16 points, coordinate by coordinate.
struct Points {
  __m512i x, y, z;
};

/// Corner k of 16 facets: four loads for each quarter of the registers, which are then turned from rows into columns. A gather
/// of each coordinate would be three loads a corner.
LAMINA_INLINE Points corners_at(const Nm* const* table, const std::uint32_t* corner) {
  const auto four = [&](std::uint32_t i) LAMINA_AVX512 {
    const auto at = [&](std::uint32_t k)
                        LAMINA_AVX512 { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(table[k] + corner[k])); };
    const __m256i low = _mm256_inserti128_si256(_mm256_castsi128_si256(at(i)), at(i + 4), 1);
    const __m256i high = _mm256_inserti128_si256(_mm256_castsi128_si256(at(i + 8)), at(i + 12), 1);
    return _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
  };
  const __m512i a = four(0), b = four(1), c = four(2), d = four(3);
  const __m512i xy_ab = _mm512_unpacklo_epi32(a, b), xy_cd = _mm512_unpacklo_epi32(c, d);
  const __m512i z_ab = _mm512_unpackhi_epi32(a, b), z_cd = _mm512_unpackhi_epi32(c, d);
  return {_mm512_unpacklo_epi64(xy_ab, xy_cd), _mm512_unpackhi_epi64(xy_ab, xy_cd), _mm512_unpacklo_epi64(z_ab, z_cd)};
}

/// The rows of eight ends at y, which lie on the edges from the tips to `other`.
LAMINA_INLINE __m256i end_rows(const PixelSampling& sampling, const CutFacets& facets, const CutFacets::Corner& other,
                               std::uint32_t i, __mmask8 live, Nm plane, __m512d y) {
  const __m512d guess =
      _mm512_add_pd(_mm512_add_pd(_mm512_mul_pd(y, _mm512_set1_pd(sampling.rows_per_nm)), _mm512_set1_pd(0.5)),
                    _mm512_set1_pd(sampling.near_y));
  const __m256i row = _mm512_cvttpd_epi32(guess);
  const __m512d beyond = _mm512_sub_pd(guess, _mm512_cvtepi32_pd(row));
  const __mmask8 near = _mm512_mask_cmp_pd_mask(live, beyond, _mm512_set1_pd(2 * sampling.near_y), _CMP_LT_OQ);
  if (near == 0) [[likely]]
    return row;
  alignas(32) std::uint32_t rows[8];
  _mm256_store_si256(reinterpret_cast<__m256i*>(rows), row);
  for (std::uint32_t k = 0; k < 8; ++k) {
    if ((near >> k & 1) != 0) rows[k] = exact_end(sampling, facets, other, i + k, plane);
  }
  return _mm256_load_si256(reinterpret_cast<const __m256i*>(rows));
}

/// Where eight edges from the tips meet the plane, 0 to 1 and in y.
struct Meetings {
  __m512d share, y;
};
LAMINA_INLINE Meetings meet(__m512d up, __m256i edge_z, __m256i tip_y, __m256i edge_y) {
  const __m512d share = _mm512_div_pd(up, _mm512_cvtepi32_pd(edge_z));
  return {share, _mm512_add_pd(_mm512_cvtepi32_pd(tip_y), _mm512_mul_pd(share, _mm512_cvtepi32_pd(edge_y)))};
}

/// Eight products of two whole numbers of 32 bits, less eight others.
LAMINA_INLINE __m512i less(__m256i a, __m256i b, __m256i c, __m256i d) {
  return _mm512_sub_epi64(_mm512_mul_epi32(_mm512_cvtepi32_epi64(a), _mm512_cvtepi32_epi64(b)),
                          _mm512_mul_epi32(_mm512_cvtepi32_epi64(c), _mm512_cvtepi32_epi64(d)));
}

LAMINA_INLINE __m512i or_flag(__m512i word, __mmask8 where, std::uint32_t bit) {
  return _mm512_mask_or_epi64(word, where, word, _mm512_set1_epi64(static_cast<long long>(std::uint64_t{bit} << 32)));
}

}  // namespace

void find(const IndexedSource& source, FoundFacets& found) {
  const IndexedCluster& cluster = *source.cluster;
  const auto sixteen = [](const std::uint8_t* bytes)
                           LAMINA_AVX512 { return _mm_load_si128(reinterpret_cast<const __m128i*>(bytes)); };
  const __m128i up = _mm_sub_epi8(_mm_set1_epi8(static_cast<char>(source.step)), sixteen(cluster.steps.low));
  const __mmask16 met = _mm_cmple_epu8_mask(up, sixteen(cluster.steps.span));
  const std::uint32_t n = found.size;
  for (std::uint32_t k = 0; k < 3; ++k) {
    const __m512i number = _mm512_maskz_compress_epi32(met, _mm512_cvtepu16_epi32(load8(cluster.corner[k])));
    _mm512_storeu_si512(found.corner[k] + n, _mm512_add_epi32(number, _mm512_add_epi32(number, number)));
  }
  const __m512i lanes = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
  _mm512_storeu_si512(found.facet + n, _mm512_add_epi32(_mm512_maskz_compress_epi32(met, lanes),
                                                        _mm512_set1_epi32(static_cast<int>(source.first_facet))));
  const __m512i table = _mm512_set1_epi64(reinterpret_cast<long long>(source.vertex));
  _mm512_storeu_si512(found.table + n, table);
  _mm512_storeu_si512(found.table + n + 8, table);
  found.size = n + static_cast<std::uint32_t>(std::popcount(static_cast<unsigned>(met)));
}

void gather(FoundFacets& found, std::uint32_t instance, const Point3& offset, Nm plane, CutFacets& facets) {
  const __m512i z = _mm512_set1_epi32(plane_in_mesh(plane, offset));
  for (auto& corner : found.corner) _mm512_storeu_si512(corner + found.size, _mm512_setzero_si512());
  std::fill_n(found.table + found.size, kClusterSize, found.table[0]);  // whole registers are read
  std::uint32_t n = facets.size;
  for (std::uint32_t i = 0; i < found.size; i += kClusterSize) {
    const unsigned live = found.size - i >= kClusterSize ? 0xFFFFu : (1u << (found.size - i)) - 1;
    const Points p = corners_at(found.table + i, found.corner[0] + i), q = corners_at(found.table + i, found.corner[1] + i),
                 r = corners_at(found.table + i, found.corner[2] + i);
    const unsigned a = _mm512_cmpgt_epi32_mask(p.z, z), b = _mm512_cmpgt_epi32_mask(q.z, z),
                   c = _mm512_cmpgt_epi32_mask(r.z, z);
    const unsigned a_b = a ^ b, a_c = a ^ c, crossed = (a_b | a_c) & live;
    const Turns turn{static_cast<__mmask16>(crossed), static_cast<__mmask16>(a_b & ~a_c), static_cast<__mmask16>(~a_b)};
    put_coordinate(turn, p.z, q.z, r.z, offset.z, facets.tip.z + n, facets.left.z + n, facets.right.z + n);
    put_coordinate(turn, p.y, q.y, r.y, offset.y, facets.tip.y + n, facets.left.y + n, facets.right.y + n);
    put_coordinate(turn, p.x, q.x, r.x, offset.x, facets.tip.x + n, facets.left.x + n, facets.right.x + n);
    _mm512_storeu_si512(facets.facet + n, _mm512_maskz_compress_epi32(turn.crossed, _mm512_loadu_si512(found.facet + i)));
    _mm512_storeu_si512(facets.instance + n, _mm512_set1_epi32(static_cast<int>(instance)));
    n += static_cast<std::uint32_t>(std::popcount(crossed));
  }
  facets.size = n;
  found.size = 0;
}

void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets) {
  const Cluster& cluster = *source.cluster;
  const __m512i z = _mm512_set1_epi32(plane_in_mesh(plane, source.offset));
  const unsigned a = _mm512_cmpgt_epi32_mask(_mm512_loadu_si512(cluster.z[0]), z),
                 b = _mm512_cmpgt_epi32_mask(_mm512_loadu_si512(cluster.z[1]), z),
                 c = _mm512_cmpgt_epi32_mask(_mm512_loadu_si512(cluster.z[2]), z);
  const unsigned a_b = a ^ b, a_c = a ^ c, crossed = a_b | a_c;
  if (crossed == 0) return;
  const Turns turn{static_cast<__mmask16>(crossed), static_cast<__mmask16>(a_b & ~a_c), static_cast<__mmask16>(~a_b)};
  const std::uint32_t n = facets.size;
  put_coordinate(turn, cluster.z, source.offset.z, facets.tip.z + n, facets.left.z + n, facets.right.z + n);
  put_coordinate(turn, cluster.y, source.offset.y, facets.tip.y + n, facets.left.y + n, facets.right.y + n);
  put_coordinate(turn, cluster.x, source.offset.x, facets.tip.x + n, facets.left.x + n, facets.right.x + n);
  const __m512i lanes = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
  _mm512_storeu_si512(facets.facet + n, _mm512_add_epi32(_mm512_maskz_compress_epi32(turn.crossed, lanes),
                                                         _mm512_set1_epi32(static_cast<int>(source.first_facet))));
  _mm512_storeu_si512(facets.instance + n, _mm512_set1_epi32(static_cast<int>(source.instance)));
  facets.size = n + static_cast<std::uint32_t>(std::popcount(crossed));
}

void cut(const PixelSampling& sampling, CutFacets& facets, Nm plane, std::uint32_t row_begin, std::uint32_t row_end,
         Segments& out) {
  out.make_room(facets.size + 8);  // eight are written, whatever counts
  std::size_t to = out.size;
  const __m512d columns_per_nm = _mm512_set1_pd(sampling.columns_per_nm);
  for (std::uint32_t i = 0; i < facets.size; i += 8) {
    const auto live = static_cast<__mmask8>(facets.size - i >= 8 ? 255u : (1u << (facets.size - i)) - 1);
    const __m256i tip_x = load8(facets.tip.x + i), tip_y = load8(facets.tip.y + i), tip_z = load8(facets.tip.z + i);
    const __m256i ux = _mm256_sub_epi32(load8(facets.left.x + i), tip_x),
                  uy = _mm256_sub_epi32(load8(facets.left.y + i), tip_y),
                  uz = _mm256_sub_epi32(load8(facets.left.z + i), tip_z),
                  vx = _mm256_sub_epi32(load8(facets.right.x + i), tip_x),
                  vy = _mm256_sub_epi32(load8(facets.right.y + i), tip_y),
                  vz = _mm256_sub_epi32(load8(facets.right.z + i), tip_z);
    const __m512d up = _mm512_cvtepi32_pd(_mm256_sub_epi32(_mm256_set1_epi32(plane), tip_z));
    const Meetings left = meet(up, uz, tip_y, uy), right = meet(up, vz, tip_y, vy);
    const __m256i row = end_rows(sampling, facets, facets.left, i, live, plane, left.y);
    const __m256i other_row = end_rows(sampling, facets, facets.right, i, live, plane, right.y);
    const __m256i first = _mm256_max_epi32(_mm256_min_epi32(row, other_row), _mm256_set1_epi32(static_cast<int>(row_begin)));
    const __m256i last = _mm256_min_epi32(_mm256_max_epi32(row, other_row), _mm256_set1_epi32(static_cast<int>(row_end)));
    const __mmask8 valid = _mm256_mask_cmplt_epi32_mask(live, first, last);

    const __m512i nx = less(uy, vz, uz, vy), ny = less(uz, vx, ux, vz);
    const __m512d slope = _mm512_div_pd(_mm512_xor_pd(_mm512_cvtepi64_pd(ny), _mm512_set1_pd(-0.0)), _mm512_cvtepi64_pd(nx));
    const __m512d x = _mm512_sub_pd(_mm512_add_pd(_mm512_cvtepi32_pd(tip_x), _mm512_mul_pd(left.share, _mm512_cvtepi32_pd(ux))),
                                    _mm512_mul_pd(slope, left.y));
    const __m512d column =
        _mm512_add_pd(_mm512_add_pd(_mm512_mul_pd(x, columns_per_nm), _mm512_set1_pd(0.5)), _mm512_set1_pd(sampling.near_x));
    const __mmask8 flat = _mm512_cmp_pd_mask(_mm512_abs_pd(slope), _mm512_set1_pd(kSteepest), _CMP_NLE_UQ);

    // One word a segment: its first row in the low half, count and flags in the high half.
    __m512i rows =
        _mm512_or_si512(_mm512_cvtepu32_epi64(first),
                        _mm512_slli_epi64(_mm512_cvtepu32_epi64(_mm256_sub_epi32(last, first)), 32 + SegmentRows::kFlagBits));
    rows = or_flag(rows, _mm512_movepi64_mask(nx), SegmentRows::kEnters);
    rows = or_flag(rows, _mm512_testn_epi64_mask(ny, ny), SegmentRows::kUpright);
    rows = or_flag(rows, flat, SegmentRows::kExact);
    const __m512i origin = _mm512_or_si512(_mm512_cvtepu32_epi64(load8(facets.facet + i)),
                                           _mm512_slli_epi64(_mm512_cvtepu32_epi64(load8(facets.instance + i)), 32));
    _mm512_storeu_pd(out.column.data() + to, _mm512_maskz_compress_pd(valid, column));
    _mm512_storeu_pd(out.columns_per_nm.data() + to, _mm512_maskz_compress_pd(valid, _mm512_mul_pd(slope, columns_per_nm)));
    _mm512_storeu_si512(out.rows.data() + to, _mm512_maskz_compress_epi64(valid, rows));
    _mm512_storeu_si512(out.origin.data() + to, _mm512_maskz_compress_epi64(valid, origin));
    to += static_cast<std::size_t>(std::popcount(static_cast<unsigned>(valid)));
  }
  out.size = to;
  facets.size = 0;
}

}  // namespace lamina::raster::avx512

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic pop
#endif
#undef LAMINA_INLINE
#endif
