#include "stages/raster/kernels/bead_rows.h"

#include <algorithm>
#include <cmath>

#include "stages/geometry/targets.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>
#endif

namespace lamina::raster {
namespace {

constexpr std::uint32_t kLanes = 8;  // of doubles

// By value, so that nothing branches.
LAMINA_BODY double lesser(double a, double b) { return a < b ? a : b; }
LAMINA_BODY double greater(double a, double b) { return a < b ? b : a; }

/// The first columns at or beyond left and beyond right, within the image.
LAMINA_BODY void whole_columns(const BeadShape& bead, const double* left, const double* right, std::int32_t* __restrict begin,
                               std::int32_t* __restrict end, std::int32_t* __restrict doubt) {
  for (std::uint32_t k = 0; k < kLanes; ++k) {
    const double from = left[k] * bead.columns_per_nm + bead.first_column;
    const double to = right[k] * bead.columns_per_nm + bead.first_column;
    const auto b = static_cast<std::int32_t>(from), e = static_cast<std::int32_t>(to);
    doubt[k] = (from - b < bead.doubt ? 1 : 0) | (to - e < bead.doubt ? 1 : 0);
    begin[k] = b < 0 ? 0 : b;
    end[k] = e < bead.columns ? e : bead.columns;
  }
}

LAMINA_BODY void square_block(const BeadShape& bead, const double* ys, double* __restrict left, double* __restrict right) {
  constexpr double kFar = 1e10;  // nm: beyond any bed
  for (std::uint32_t k = 0; k < kLanes; ++k) {
    const double y = ys[k] - bead.y0, line = y * bead.slope, across = y * bead.turned;
    left[k] = lesser(greater(line - bead.aside, across + bead.end[0]), kFar);
    right[k] = greater(lesser(line + bead.aside, across + bead.end[1]), -kFar);
  }
}

/// Rows between the discs.
LAMINA_BODY void line_block(const BeadShape& bead, const double* ys, double* __restrict left, double* __restrict right) {
  for (std::uint32_t k = 0; k < kLanes; ++k) {
    const double line = (ys[k] - bead.y0) * bead.slope;
    left[k] = line - bead.aside;
    right[k] = line + bead.aside;
  }
}

LAMINA_BODY void round_block(const BeadShape& bead, const double* ys, double* __restrict left, double* __restrict right) {
  for (std::uint32_t k = 0; k < kLanes; ++k) {
    const double y = ys[k] - bead.y0, up = y - bead.dy, line = y * bead.slope;
    const double low = std::sqrt(greater(bead.radius2 - y * y, 0)), high = std::sqrt(greater(bead.radius2 - up * up, 0));
    const double on_left = y < bead.left[1] ? line - bead.aside : bead.dx - high;
    const double on_right = y < bead.right[1] ? line + bead.aside : bead.dx + high;
    left[k] = y < bead.left[0] ? -low : on_left;
    right[k] = y < bead.right[0] ? low : on_right;
  }
}

LAMINA_BODY void empty(BeadRows& rows, std::uint32_t first, std::uint32_t last) {
  for (std::uint32_t r = first; r < last; ++r) rows.begin[r] = INT32_MAX, rows.end[r] = 0, rows.doubt[r] = 0;
}

LAMINA_BODY bool columns_body(const BeadShape& bead, std::uint32_t first, std::uint32_t last, BeadRows& rows) {
  alignas(64) double left[kLanes], right[kLanes];
  // Image rows go down: y of the last row of a block is its lowest.
  const double low = bead.y0 + std::max(bead.left[0], bead.right[0]), high = bead.y0 + std::min(bead.left[1], bead.right[1]);
  std::int32_t doubt = 0;
  for (std::uint32_t r = first / kLanes * kLanes; r < last; r += kLanes) {
    const double* const y = rows.y + r;
    if (bead.square) square_block(bead, y, left, right);
    else if (y[0] <= high && y[kLanes - 1] >= low) line_block(bead, y, left, right);
    else round_block(bead, y, left, right);
    whole_columns(bead, left, right, rows.begin + r, rows.end + r, rows.doubt + r);
    for (std::uint32_t k = 0; k < kLanes; ++k) doubt |= rows.doubt[r + k];
  }
  empty(rows, first / kBeadBlockRows * kBeadBlockRows, first);
  empty(rows, last, (last + kBeadBlockRows - 1) / kBeadBlockRows * kBeadBlockRows);
  return doubt != 0;
}

bool columns_plain(const BeadShape& bead, std::uint32_t first, std::uint32_t last, BeadRows& rows) {
  return columns_body(bead, first, last, rows);
}

void set_plain(const BeadRows& rows, std::uint32_t first, std::uint32_t last, std::uint32_t* words, std::uint8_t* touched) {
  for (std::uint32_t r = first; r < last; ++r) {
    if (rows.begin[r] >= rows.end[r]) continue;
    const auto begin = static_cast<std::uint32_t>(rows.begin[r]), end = static_cast<std::uint32_t>(rows.end[r]) - 1;
    const std::uint32_t from = begin / kBeadWordBits, to = end / kBeadWordBits;
    for (std::uint32_t w = from; w <= to; ++w) {
      const std::uint32_t mask = (w == from ? UINT32_MAX << begin % kBeadWordBits : UINT32_MAX) &
                                 (w == to ? UINT32_MAX >> (kBeadWordBits - 1 - end % kBeadWordBits) : UINT32_MAX);
      words[std::size_t{w} * kBeadBandRows + r] |= mask;
      touched[w] = 1;
    }
  }
}

std::uint64_t changes_plain(std::uint32_t* words, std::uint32_t* carry, std::uint32_t* changed) {
  std::uint64_t rows = 0;
  for (std::uint32_t r = 0; r < kBeadBandRows; ++r) {
    const std::uint32_t word = words[r];
    words[r] = 0;
    changed[r] = word ^ (word << 1 | carry[r]);
    carry[r] = word >> (kBeadWordBits - 1);
    rows |= static_cast<std::uint64_t>(changed[r] != 0 ? 1 : 0) << r;
  }
  return rows;
}

#if defined(LAMINA_WIDE_KERNELS)

LAMINA_AVX2 bool columns_avx2(const BeadShape& bead, std::uint32_t first, std::uint32_t last, BeadRows& rows) {
  return columns_body(bead, first, last, rows);
}

LAMINA_AVX2 void set_avx2(const BeadRows& rows, std::uint32_t first, std::uint32_t last, std::uint32_t* words,
                          std::uint8_t* touched) {
  const __m256i all = _mm256_set1_epi32(-1), none = _mm256_setzero_si256();
  for (std::uint32_t r = first / 8 * 8; r < last; r += 8) {
    __m256i begin = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(rows.begin + r));
    __m256i end = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(rows.end + r));
    alignas(32) std::int32_t lowest[8], highest[8];
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(lowest), begin);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(highest), end);
    std::int32_t low = lowest[0], high = highest[0];
    for (int k = 1; k < 8; ++k) low = std::min(low, lowest[k]), high = std::max(high, highest[k]);
    if (low >= high) continue;
    const std::uint32_t from = static_cast<std::uint32_t>(low) / kBeadWordBits;
    const std::uint32_t to = (static_cast<std::uint32_t>(high) - 1) / kBeadWordBits;
    const __m256i before = _mm256_set1_epi32(static_cast<int>(from * kBeadWordBits)), step = _mm256_set1_epi32(kBeadWordBits);
    begin = _mm256_sub_epi32(begin, before);
    end = _mm256_sub_epi32(end, before);
    for (std::uint32_t w = from; w <= to; ++w) {
      const __m256i from_begin = _mm256_sllv_epi32(all, _mm256_max_epi32(begin, none));
      const __m256i from_end = _mm256_sllv_epi32(all, _mm256_max_epi32(end, none));
      auto* const at = reinterpret_cast<__m256i*>(words + std::size_t{w} * kBeadBandRows + r);
      _mm256_storeu_si256(at, _mm256_or_si256(_mm256_loadu_si256(at), _mm256_andnot_si256(from_end, from_begin)));
      touched[w] = 1;
      begin = _mm256_sub_epi32(begin, step);
      end = _mm256_sub_epi32(end, step);
    }
  }
}

LAMINA_AVX2 std::uint64_t changes_avx2(std::uint32_t* words, std::uint32_t* carry, std::uint32_t* changed) {
  std::uint64_t rows = 0;
  for (std::uint32_t r = 0; r < kBeadBandRows; r += 8) {
    auto* const at = reinterpret_cast<__m256i*>(words + r);
    auto* const before = reinterpret_cast<__m256i*>(carry + r);
    const __m256i word = _mm256_loadu_si256(at);
    _mm256_storeu_si256(at, _mm256_setzero_si256());
    const __m256i differs = _mm256_xor_si256(word, _mm256_or_si256(_mm256_slli_epi32(word, 1), _mm256_loadu_si256(before)));
    _mm256_storeu_si256(before, _mm256_srli_epi32(word, kBeadWordBits - 1));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(changed + r), differs);
    const __m256i same = _mm256_cmpeq_epi32(differs, _mm256_setzero_si256());
    const auto lanes = static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(same))) ^ 0xFF;
    rows |= std::uint64_t{lanes} << r;
  }
  return rows;
}

LAMINA_AVX512_BEGIN

LAMINA_AVX512 bool columns_avx512(const BeadShape& bead, std::uint32_t first, std::uint32_t last, BeadRows& rows) {
  return columns_body(bead, first, last, rows);
}

LAMINA_AVX512 void set_avx512(const BeadRows& rows, std::uint32_t first, std::uint32_t last, std::uint32_t* words,
                              std::uint8_t* touched) {
  const __m512i all = _mm512_set1_epi32(-1), none = _mm512_setzero_si512(), step = _mm512_set1_epi32(kBeadWordBits);
  for (std::uint32_t r = first / 16 * 16; r < last; r += 16) {
    __m512i begin = _mm512_loadu_si512(rows.begin + r), end = _mm512_loadu_si512(rows.end + r);
    const std::int32_t low = _mm512_reduce_min_epi32(begin), high = _mm512_reduce_max_epi32(end);
    if (low >= high) continue;
    const std::uint32_t from = static_cast<std::uint32_t>(low) / kBeadWordBits;
    const std::uint32_t to = (static_cast<std::uint32_t>(high) - 1) / kBeadWordBits;
    const __m512i before = _mm512_set1_epi32(static_cast<int>(from * kBeadWordBits));
    begin = _mm512_sub_epi32(begin, before);
    end = _mm512_sub_epi32(end, before);
    for (std::uint32_t w = from; w <= to; ++w) {
      const __m512i from_begin = _mm512_sllv_epi32(all, _mm512_max_epi32(begin, none));
      const __m512i from_end = _mm512_sllv_epi32(all, _mm512_max_epi32(end, none));
      std::uint32_t* const at = words + std::size_t{w} * kBeadBandRows + r;
      _mm512_storeu_si512(at, _mm512_or_si512(_mm512_loadu_si512(at), _mm512_andnot_si512(from_end, from_begin)));
      touched[w] = 1;
      begin = _mm512_sub_epi32(begin, step);
      end = _mm512_sub_epi32(end, step);
    }
  }
}

LAMINA_AVX512 std::uint64_t changes_avx512(std::uint32_t* words, std::uint32_t* carry, std::uint32_t* changed) {
  std::uint64_t rows = 0;
  for (std::uint32_t r = 0; r < kBeadBandRows; r += 16) {
    const __m512i word = _mm512_loadu_si512(words + r);
    _mm512_storeu_si512(words + r, _mm512_setzero_si512());
    const __m512i differs = _mm512_xor_si512(word, _mm512_or_si512(_mm512_slli_epi32(word, 1), _mm512_loadu_si512(carry + r)));
    _mm512_storeu_si512(carry + r, _mm512_srli_epi32(word, kBeadWordBits - 1));
    _mm512_storeu_si512(changed + r, differs);
    rows |= std::uint64_t{_mm512_test_epi32_mask(differs, differs)} << r;
  }
  return rows;
}

LAMINA_AVX512_END
#endif

}  // namespace

const BeadKernels& bead_kernels_for([[maybe_unused]] Isa isa) {
  static constexpr BeadKernels kPlain{columns_plain, set_plain, changes_plain};
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr BeadKernels kAvx2{columns_avx2, set_avx2, changes_avx2};
  static constexpr BeadKernels kAvx512{columns_avx512, set_avx512, changes_avx512};
  if (isa == Isa::kAvx512) return kAvx512;
  if (isa == Isa::kAvx2) return kAvx2;
#endif
  return kPlain;
}

}  // namespace lamina::raster
