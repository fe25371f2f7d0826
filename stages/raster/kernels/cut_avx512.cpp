// Cutting with AVX-512: facets are found and cut 16 at a time, doubles eight at a time.
//
// The bits are those of plain::cut(): corners are moved, and the same operations of IEEE 754 are done in the same order in
// each lane; ends near a whole number go to the same integers.
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#include <bit>

#define LAMINA_INLINE LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::raster::avx512 {
namespace {

LAMINA_INLINE __m256i load8(const void* at) { return _mm256_loadu_si256(static_cast<const __m256i*>(at)); }
LAMINA_INLINE __m512i load16(const void* at) { return _mm512_loadu_si512(at); }

/// What turns 16 facets: those that the plane crosses, and which of them have corner 1 or 2 as tip.
struct Turns {
  __mmask16 crossed, tip_is_1, tip_is_2;
  LAMINA_INLINE __m512i tip(__m512i a, __m512i b, __m512i c) const {
    return _mm512_mask_mov_epi32(_mm512_mask_mov_epi32(a, tip_is_1, b), tip_is_2, c);
  }
};
LAMINA_INLINE Turns turns_of(__m512i a_z, __m512i b_z, __m512i c_z, __m512i plane) {
  const unsigned a = _mm512_cmpgt_epi32_mask(a_z, plane), b = _mm512_cmpgt_epi32_mask(b_z, plane),
                 c = _mm512_cmpgt_epi32_mask(c_z, plane);
  const unsigned a_b = a ^ b, a_c = a ^ c;
  return {static_cast<__mmask16>(a_b | a_c), static_cast<__mmask16>(a_b & ~a_c), static_cast<__mmask16>(~a_b)};
}

/// The plane in the frame of a mesh, and heights as they count for it (height_for_plane()).
struct Planes {
  __m512i z, reach;
  LAMINA_INLINE explicit Planes(const PlaneInMesh& plane)
      : z(_mm512_set1_epi32(plane.z)), reach(_mm512_set1_epi32(plane.reach)) {}
  LAMINA_INLINE __m512i counted(__m512i height) const {
    return _mm512_mask_min_epi32(height, _mm512_cmple_epi32_mask(height, reach), height, z);
  }
};

/// One coordinate of 16 facets, turned.
struct Turned {
  __m512i tip, left, right;  // edges from the tip
};
LAMINA_INLINE Turned turned(const Turns& turn, __m512i a, __m512i b, __m512i c) {
  const __m512i tip = turn.tip(a, b, c);
  return {tip, _mm512_sub_epi32(turn.tip(b, c, a), tip), _mm512_sub_epi32(turn.tip(c, a, b), tip)};
}

/// 16 points, coordinate by coordinate.
struct Points {
  __m512i x, y, z;
};

/// Corner k of 16 facets: four loads for each quarter of the registers, which are then turned from rows into columns. A gather
/// of each coordinate would be three loads a corner.
LAMINA_INLINE Points corners_at(const Nm* base, const std::int32_t* corner) {
  const auto at = [&](std::uint32_t k)
                      LAMINA_AVX512 { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(base + corner[k])); };
  const auto four = [&](std::uint32_t i) LAMINA_AVX512 {
    const __m512i two = _mm512_inserti32x4(_mm512_castsi128_si512(at(i)), at(i + 4), 1);
    return _mm512_inserti32x4(_mm512_inserti32x4(two, at(i + 8), 2), at(i + 12), 3);
  };
  const __m512i a = four(0), b = four(1), c = four(2), d = four(3);
  const __m512i xy_ab = _mm512_unpacklo_epi32(a, b), xy_cd = _mm512_unpacklo_epi32(c, d);
  const __m512i z_ab = _mm512_unpackhi_epi32(a, b), z_cd = _mm512_unpackhi_epi32(c, d);
  return {_mm512_unpacklo_epi64(xy_ab, xy_cd), _mm512_unpackhi_epi64(xy_ab, xy_cd), _mm512_unpacklo_epi64(z_ab, z_cd)};
}

/// Numbers of 16 facets (CutFacets::Number).
struct Sixteen {
  const Nm* number;
  LAMINA_INLINE const Nm* at(std::uint32_t which) const { return number + which * CutFacets::kStride; }
  LAMINA_INLINE __m512i whole(std::uint32_t which) const { return _mm512_loadu_si512(at(which)); }
  LAMINA_INLINE __m512d real(std::uint32_t which, std::uint32_t first) const {
    return _mm512_cvtepi32_pd(load8(at(which) + first));
  }
};

/// What all facets of a task share, and where the next segment goes: kept in registers, since what is written could be anything
/// for all that compilers know.
struct Cutter {
  const CutTask& task;
  double *column, *columns_per_nm;
  SegmentRows* rows;
  SegmentOrigin* origin;
  std::size_t to;
  __m512d rows_in_nm, row_shift, near_rows, columns_in_nm, column_shift;
  __m512i row_begin, row_end;
};
LAMINA_INLINE Cutter cutter_for(const CutTask& task) {
  const PixelSampling& sampling = task.sampling;
  Segments& out = task.out;
  return {task,
          out.column.data(),
          out.columns_per_nm.data(),
          out.rows.data(),
          out.origin.data(),
          out.size,
          _mm512_set1_pd(sampling.rows_per_nm),
          _mm512_set1_pd(0.5 + sampling.near_y),
          _mm512_set1_pd(2 * sampling.near_y),
          _mm512_set1_pd(sampling.columns_per_nm),
          _mm512_set1_pd(0.5 + sampling.near_x),
          _mm512_set1_epi32(static_cast<int>(task.row_begin)),
          _mm512_set1_epi32(static_cast<int>(task.row_end))};
}

/// The rows of eight ends at y, which lie on the edges whose y and z follow `edge_x`.
LAMINA_INLINE __m256i end_rows(const Cutter& cutter, Sixteen of, std::uint32_t edge_x, std::uint32_t i, __mmask8 live,
                               __m512d y) {
  const __m512d guess = _mm512_add_pd(_mm512_mul_pd(y, cutter.rows_in_nm), cutter.row_shift);
  const __m256i row = _mm512_cvttpd_epi32(guess);
  const __m512d beyond = _mm512_sub_pd(guess, _mm512_cvtepi32_pd(row));
  const __mmask8 near = _mm512_mask_cmp_pd_mask(live, beyond, cutter.near_rows, _CMP_LT_OQ);
  if (near == 0) [[likely]]
    return row;
  alignas(32) std::uint32_t rows[8];
  _mm256_store_si256(reinterpret_cast<__m256i*>(rows), row);
  for (std::uint32_t k = 0; k < 8; ++k) {
    if ((near >> k & 1) == 0) continue;
    const auto number = [&](std::uint32_t which) LAMINA_AVX512 { return of.at(which)[i + k]; };
    rows[k] =
        exact_end(cutter.task.sampling, number(CutFacets::kTipY), number(CutFacets::kUp), number(edge_x + 1), number(edge_x + 2));
  }
  return _mm256_load_si256(reinterpret_cast<const __m256i*>(rows));
}

/// Where the plane cuts eight facets.
struct Cuts {
  __m256i row, other_row;
  __m512d column, columns_per_nm;
  __mmask8 flat;
};
LAMINA_INLINE Cuts cut_eight(const Cutter& cutter, Sixteen of, std::uint32_t i, __mmask8 live) {
  const __m512d left_z = of.real(CutFacets::kLeftZ, i), right_z = of.real(CutFacets::kRightZ, i);
  const __m512d share = _mm512_div_pd(of.real(CutFacets::kUp, i), _mm512_mul_pd(left_z, right_z));
  const __m512d to_left = _mm512_mul_pd(share, right_z), to_right = _mm512_mul_pd(share, left_z);
  const __m512d left_y = _mm512_mul_pd(to_left, of.real(CutFacets::kLeftY, i)),
                right_y = _mm512_mul_pd(to_right, of.real(CutFacets::kRightY, i));
  const __m512d left_x = _mm512_mul_pd(to_left, of.real(CutFacets::kLeftX, i)),
                right_x = _mm512_mul_pd(to_right, of.real(CutFacets::kRightX, i));
  const __m512d slope = _mm512_div_pd(_mm512_sub_pd(right_x, left_x), _mm512_sub_pd(right_y, left_y));
  const __m512d tip_y = of.real(CutFacets::kTipY, i), y = _mm512_add_pd(tip_y, left_y);
  const __m512d x = _mm512_sub_pd(_mm512_add_pd(of.real(CutFacets::kTipX, i), left_x), _mm512_mul_pd(slope, y));
  return {end_rows(cutter, of, CutFacets::kLeftX, i, live, y),
          end_rows(cutter, of, CutFacets::kRightX, i, live, _mm512_add_pd(tip_y, right_y)),
          _mm512_add_pd(_mm512_mul_pd(x, cutter.columns_in_nm), cutter.column_shift),
          _mm512_mul_pd(slope, cutter.columns_in_nm),
          _mm512_cmp_pd_mask(_mm512_abs_pd(slope), _mm512_set1_pd(kSteepest), _CMP_NLE_UQ)};
}

LAMINA_INLINE __m512i both(__m256i low, __m256i high) { return _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1); }
LAMINA_INLINE __m512i or_flag(__m512i word, __mmask16 where, std::uint32_t bit) {
  return _mm512_mask_or_epi32(word, where, word, _mm512_set1_epi32(static_cast<int>(bit)));
}
/// 16 pairs of numbers.
LAMINA_INLINE void put_pairs(void* to, __m512i first, __m512i second) {
  const __m512i low = _mm512_set_epi32(23, 7, 22, 6, 21, 5, 20, 4, 19, 3, 18, 2, 17, 1, 16, 0);
  const __m512i high = _mm512_add_epi32(low, _mm512_set1_epi32(8));
  _mm512_storeu_si512(to, _mm512_permutex2var_epi32(first, low, second));
  _mm512_storeu_si512(static_cast<__m512i*>(to) + 1, _mm512_permutex2var_epi32(first, high, second));
}

/// Appends the segments of the live ones of 16 facets; the arrays are long enough.
LAMINA_INLINE void cut_sixteen(Cutter& cutter, Sixteen of, __mmask16 live, __m512i facet, __m512i instance) {
  const Cuts low = cut_eight(cutter, of, 0, static_cast<__mmask8>(live)),
             high = cut_eight(cutter, of, 8, static_cast<__mmask8>(live >> 8));
  const __m512i row = both(low.row, high.row), other_row = both(low.other_row, high.other_row);
  const __m512i first = _mm512_max_epi32(_mm512_min_epi32(row, other_row), cutter.row_begin);
  const __m512i last = _mm512_min_epi32(_mm512_max_epi32(row, other_row), cutter.row_end);
  const unsigned valid = _mm512_mask_cmplt_epi32_mask(live, first, last);

  const __m512i left_z = of.whole(CutFacets::kLeftZ);
  const __m512i rise = _mm512_or_si512(_mm512_abs_epi32(left_z), _mm512_abs_epi32(of.whole(CutFacets::kRightZ)));
  const __mmask16 level = _mm512_mask_cmplt_epi32_mask(live, rise, _mm512_set1_epi32(kLevelEdge));
  if (level != 0) [[unlikely]] {
    alignas(64) std::uint32_t instances[kClusterSize];
    _mm512_store_si512(instances, instance);
    note_level(cutter.task, of.number, level, instances);
  }

  const __m512i down = _mm512_xor_si512(_mm512_sub_epi32(row, other_row), left_z);
  const __m512i edges_x = _mm512_or_si512(of.whole(CutFacets::kLeftX), of.whole(CutFacets::kRightX));
  __m512i count = _mm512_or_si512(_mm512_slli_epi32(_mm512_sub_epi32(last, first), SegmentRows::kFlagBits),
                                  _mm512_srli_epi32(down, 31));  // SegmentRows::kEnters
  count = or_flag(count, _mm512_testn_epi32_mask(edges_x, edges_x), SegmentRows::kUpright);
  count = or_flag(count, static_cast<__mmask16>(low.flat | high.flat << 8), SegmentRows::kExact);

  const auto to_low = static_cast<__mmask8>(valid), to_high = static_cast<__mmask8>(valid >> 8);
  const std::size_t to = cutter.to, middle = to + static_cast<std::size_t>(std::popcount(valid & 255));
  const auto put = [&](double* at, __m512d if_low, __m512d if_high) LAMINA_AVX512 {
    _mm512_storeu_pd(at + to, _mm512_maskz_compress_pd(to_low, if_low));
    _mm512_storeu_pd(at + middle, _mm512_maskz_compress_pd(to_high, if_high));
  };
  put(cutter.column, low.column, high.column);
  put(cutter.columns_per_nm, low.columns_per_nm, high.columns_per_nm);
  const auto compressed = [&](__m512i v)
                              LAMINA_AVX512 { return _mm512_maskz_compress_epi32(static_cast<__mmask16>(valid), v); };
  put_pairs(cutter.rows + to, compressed(first), compressed(count));
  put_pairs(cutter.origin + to, compressed(facet), compressed(instance));
  cutter.to = to + static_cast<std::size_t>(std::popcount(valid));
}

}  // namespace

std::size_t find(const IndexedSource& source, std::span<const ClusterVisit> visits, FoundFacets& found) {
  const auto sixteen = [](const std::uint8_t* bytes)
                           LAMINA_AVX512 { return _mm_load_si128(reinterpret_cast<const __m128i*>(bytes)); };
  const __m128i step = _mm_set1_epi8(static_cast<char>(source.step));
  const __m512i lanes = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
  const __m512i first = _mm512_set1_epi32(found.first_of(source.vertex));
  std::uint32_t n = found.size;
  std::size_t i = 0;
  for (; i < visits.size() && n <= FoundFacets::kCapacity - kClusterSize; ++i) {
    const IndexedCluster& cluster = source.at(visits[i]);
    const __mmask16 met = _mm_cmple_epu8_mask(_mm_sub_epi8(step, sixteen(cluster.steps.low)), sixteen(cluster.steps.span));
    for (std::uint32_t k = 0; k < 3; ++k) {
      const __m512i number = _mm512_maskz_compress_epi32(met, _mm512_cvtepu16_epi32(load8(cluster.corner[k])));
      const __m512i position = _mm512_add_epi32(_mm512_madd_epi16(number, _mm512_set1_epi32(3)), first);  // number < 2^15
      _mm512_storeu_si512(found.corner[k] + n, position);
    }
    _mm512_storeu_si512(found.facet + n,
                        _mm512_add_epi32(_mm512_maskz_compress_epi32(met, lanes),
                                         _mm512_set1_epi32(static_cast<int>(visits[i].cluster * kClusterSize))));
    fetch_early(source, visits, i, found, n);
    n += static_cast<std::uint32_t>(std::popcount(static_cast<unsigned>(met)));
  }
  found.size = n;
  return i;
}

void cut_found(const CutTask& task, std::uint32_t instance, const Point3& offset, FoundFacets& found) {
  CutFacets facets;
  __mmask16 crossed[CutFacets::kCapacity / kClusterSize];
  std::uint32_t count = 0;
  for (auto& corner : found.corner) _mm512_storeu_si512(corner + found.size, _mm512_setzero_si512());  // whole registers
  const Planes plane(plane_in_mesh(task.plane, offset));
  for (std::uint32_t i = 0; i < found.size; i += kClusterSize) {
    const unsigned live = found.size - i >= kClusterSize ? 0xFFFFu : (1u << (found.size - i)) - 1;
    const Points p = corners_at(found.base, found.corner[0] + i), q = corners_at(found.base, found.corner[1] + i),
                 r = corners_at(found.base, found.corner[2] + i);
    const Turns turn = turns_of(p.z, q.z, r.z, plane.reach);
    crossed[i / kClusterSize] = static_cast<__mmask16>(turn.crossed & live);
    count += static_cast<std::uint32_t>(std::popcount(turn.crossed & live));
    const auto put = [&](std::uint32_t which, __m512i v) LAMINA_AVX512 { _mm512_store_si512(facets.number[which] + i, v); };
    const Turned in_z = turned(turn, plane.counted(p.z), plane.counted(q.z), plane.counted(r.z));
    put(CutFacets::kUp, _mm512_sub_epi32(plane.z, in_z.tip));
    put(CutFacets::kLeftZ, in_z.left), put(CutFacets::kRightZ, in_z.right);
    const Turned in_y = turned(turn, p.y, q.y, r.y);
    put(CutFacets::kTipY, _mm512_add_epi32(in_y.tip, _mm512_set1_epi32(offset.y)));
    put(CutFacets::kLeftY, in_y.left), put(CutFacets::kRightY, in_y.right);
    const Turned in_x = turned(turn, p.x, q.x, r.x);
    put(CutFacets::kTipX, _mm512_add_epi32(in_x.tip, _mm512_set1_epi32(offset.x)));
    put(CutFacets::kLeftX, in_x.left), put(CutFacets::kRightX, in_x.right);
  }
  task.out.ensure_capacity(count + kClusterSize);  // 16 are written, regardless of how many count
  const __m512i of_instance = _mm512_set1_epi32(static_cast<int>(instance));
  Cutter cutter = cutter_for(task);
  for (std::uint32_t i = 0; i < found.size; i += kClusterSize) {
    cut_sixteen(cutter, Sixteen{facets.number[0] + i}, crossed[i / kClusterSize], _mm512_loadu_si512(found.facet + i),
                of_instance);
  }
  task.out.size = cutter.to;
  found.size = 0;
}

void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets) {
  const Cluster& cluster = *source.cluster;
  const Planes in_mesh(plane_in_mesh(plane, source.offset));
  const __m512i a_z = load16(cluster.z[0]), b_z = load16(cluster.z[1]), c_z = load16(cluster.z[2]);
  const Turns turn = turns_of(a_z, b_z, c_z, in_mesh.reach);
  if (turn.crossed == 0) return;
  const std::uint32_t n = facets.size;
  const auto put = [&](std::uint32_t which, __m512i v) LAMINA_AVX512 {
    _mm512_storeu_si512(facets.number[which] + n, _mm512_maskz_compress_epi32(turn.crossed, v));
  };
  const auto put_edges = [&](const Turned& v, std::uint32_t left, std::uint32_t right) LAMINA_AVX512 {
    put(left, v.left), put(right, v.right);
    return v.tip;
  };
  const auto turned_corners = [&](const Nm(&of)[3][kClusterSize])
                                  LAMINA_AVX512 { return turned(turn, load16(of[0]), load16(of[1]), load16(of[2])); };
  const Turned z = turned(turn, in_mesh.counted(a_z), in_mesh.counted(b_z), in_mesh.counted(c_z));
  put(CutFacets::kUp, _mm512_sub_epi32(in_mesh.z, put_edges(z, CutFacets::kLeftZ, CutFacets::kRightZ)));
  const __m512i tip_y = put_edges(turned_corners(cluster.y), CutFacets::kLeftY, CutFacets::kRightY);
  put(CutFacets::kTipY, _mm512_add_epi32(tip_y, _mm512_set1_epi32(source.offset.y)));
  const __m512i tip_x = put_edges(turned_corners(cluster.x), CutFacets::kLeftX, CutFacets::kRightX);
  put(CutFacets::kTipX, _mm512_add_epi32(tip_x, _mm512_set1_epi32(source.offset.x)));
  const __m512i lanes = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
  _mm512_storeu_si512(facets.facet + n, _mm512_add_epi32(_mm512_maskz_compress_epi32(turn.crossed, lanes),
                                                         _mm512_set1_epi32(static_cast<int>(source.first_facet))));
  _mm512_storeu_si512(facets.instance + n, _mm512_set1_epi32(static_cast<int>(source.instance)));
  facets.size = n + static_cast<std::uint32_t>(std::popcount(static_cast<unsigned>(turn.crossed)));
}

void cut(const CutTask& task, CutFacets& facets) {
  task.out.ensure_capacity(facets.size + kClusterSize);
  Cutter cutter = cutter_for(task);
  for (std::uint32_t i = 0; i < facets.size; i += kClusterSize) {
    const unsigned live = facets.size - i >= kClusterSize ? 0xFFFFu : (1u << (facets.size - i)) - 1;
    const __m512i instance = _mm512_loadu_si512(facets.instance + i);
    cut_sixteen(cutter, Sixteen{facets.number[0] + i}, static_cast<__mmask16>(live), _mm512_loadu_si512(facets.facet + i),
                instance);
  }
  task.out.size = cutter.to;
  facets.size = 0;
}

}  // namespace lamina::raster::avx512

LAMINA_AVX512_END
#undef LAMINA_INLINE
#endif
