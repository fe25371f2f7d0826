#include "stages/raster/kernels/bead_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "stages/geometry/targets.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>
#endif

namespace lamina::raster {
namespace {

/// As many doubles as a register has: comparisons of wider vectors become those of single numbers.
struct Two {
  typedef double Doubles __attribute__((vector_size(16)));
  typedef std::int32_t Integers __attribute__((vector_size(8)));
};
struct Four {
  typedef double Doubles __attribute__((vector_size(32)));
  typedef std::int32_t Integers __attribute__((vector_size(16)));
};
struct Eight {
  typedef double Doubles __attribute__((vector_size(64)));
  typedef std::int32_t Integers __attribute__((vector_size(32)));
};

// By reference, so that no vector is passed in registers that another instruction set does not have.

/// Of what is not below 0, else 0.
template <class Doubles>
LAMINA_BODY void root(Doubles& x) {
  double lane[sizeof(Doubles) / sizeof(double)];
  x = x < 0 ? Doubles{} : x;
  std::memcpy(lane, &x, sizeof x);
  for (double& one : lane) one = std::sqrt(one);
  std::memcpy(&x, lane, sizeof x);
}

/// The first columns at or beyond left and beyond right, within the image.
/// nearest  becomes the lowest of rows.near
template <class Doubles, class Integers>
LAMINA_BODY void whole_columns(const BeadShape& bead, const Doubles& left, const Doubles& right, std::uint32_t first,
                               BeadRows& rows, Doubles& nearest) {
  const Doubles from = left * bead.columns_per_nm + bead.first_column, to = right * bead.columns_per_nm + bead.first_column;
  Integers begin = __builtin_convertvector(from, Integers), end = __builtin_convertvector(to, Integers);
  const Doubles near_begin = from - __builtin_convertvector(begin, Doubles);
  const Doubles near_end = to - __builtin_convertvector(end, Doubles);
  const Doubles near = near_begin < near_end ? near_begin : near_end;
  begin = begin < 0 ? Integers{} : begin;
  end = end < bead.columns ? end : Integers{} + bead.columns;
  std::memcpy(rows.begin + first, &begin, sizeof begin);
  std::memcpy(rows.end + first, &end, sizeof end);
  std::memcpy(rows.near + first, &near, sizeof near);
  nearest = near < nearest ? near : nearest;
}

template <class Doubles>
LAMINA_BODY void square_block(const BeadShape& bead, const Doubles& y, Doubles& left, Doubles& right) {
  constexpr double kFar = 1e10;  // nm: beyond any bed
  const Doubles from = y * bead.slope - bead.aside, from_end = y * bead.turned + bead.end[0];
  const Doubles to = y * bead.slope + bead.aside, to_end = y * bead.turned + bead.end[1];
  left = from > from_end ? from : from_end;
  right = to < to_end ? to : to_end;
  left = left < kFar ? left : Doubles{} + kFar;
  right = right > -kFar ? right : Doubles{} - kFar;
}

/// Rows that reach below or above the edges along the bead, where the discs are its boundary.
template <class Doubles>
LAMINA_BODY void round_block(const BeadShape& bead, const Doubles& y, bool below, bool above, Doubles& left, Doubles& right) {
  left = y * bead.slope - bead.aside;
  right = y * bead.slope + bead.aside;
  if (above) {
    const Doubles up = y - bead.dy;
    Doubles reach = bead.radius2 - up * up;
    root(reach);
    left = y < bead.left[1] ? left : bead.dx - reach;
    right = y < bead.right[1] ? right : bead.dx + reach;
  }
  if (!below) return;
  Doubles reach = bead.radius2 - y * y;
  root(reach);
  left = y < bead.left[0] ? -reach : left;
  right = y < bead.right[0] ? reach : right;
}

template <class Vectors>
LAMINA_BODY bool columns_body(const BeadShape& bead, std::uint32_t first, std::uint32_t last, BeadRows& rows) {
  using Doubles = typename Vectors::Doubles;
  constexpr std::uint32_t kLanes = sizeof(Doubles) / sizeof(double);
  Doubles nearest = Doubles{} + 1;
  // Image rows go down: y of the last row of a block is its lowest.
  const double low = bead.y0 + std::max(bead.left[0], bead.right[0]), high = bead.y0 + std::min(bead.left[1], bead.right[1]);
  for (std::uint32_t next = first; next < last; next += kLanes) {
    const std::uint32_t r = std::min(next, kBeadBandRows - kLanes);
    Doubles y, left, right;
    std::memcpy(&y, rows.y + r, sizeof y);
    y -= bead.y0;
    if (bead.square) {
      square_block(bead, y, left, right);
    } else {
      round_block(bead, y, rows.y[r + kLanes - 1]<low, rows.y[r]> high, left, right);
    }
    whole_columns<Doubles, typename Vectors::Integers>(bead, left, right, r, rows, nearest);
  }
  double lowest = 1;
  for (std::uint32_t k = 0; k < kLanes; ++k) lowest = std::min(lowest, nearest[k]);
  return lowest < bead.tolerance;
}

bool columns_plain(const BeadShape& bead, std::uint32_t first, std::uint32_t last, BeadRows& rows) {
  return columns_body<Two>(bead, first, last, rows);
}

void set_plain(const BeadRows& rows, std::uint32_t first, std::uint32_t last, const std::array<std::uint32_t, 2>&,
               std::uint32_t* words, std::uint8_t* touched) {
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
  return columns_body<Four>(bead, first, last, rows);
}

LAMINA_AVX2 void set_avx2(const BeadRows& rows, std::uint32_t first, std::uint32_t last,
                          const std::array<std::uint32_t, 2>& within, std::uint32_t* words, std::uint8_t* touched) {
  constexpr std::uint32_t kRows = 8;
  const __m256i all = _mm256_set1_epi32(-1), none = _mm256_setzero_si256(), step = _mm256_set1_epi32(kBeadWordBits);
  const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256i begins = _mm256_set1_epi32(static_cast<int>(first)), ends = _mm256_set1_epi32(static_cast<int>(last));
  const __m256i before = _mm256_set1_epi32(static_cast<int>(within[0] * kBeadWordBits));
  for (std::uint32_t w = within[0]; w <= within[1]; ++w) touched[w] = 1;
  for (std::uint32_t next = first; next < last; next += kRows) {
    const std::uint32_t r = std::min(next, kBeadBandRows - kRows);
    const __m256i row = _mm256_add_epi32(lanes, _mm256_set1_epi32(static_cast<int>(r)));
    const __m256i kept = _mm256_andnot_si256(_mm256_cmpgt_epi32(begins, row), _mm256_cmpgt_epi32(ends, row));
    __m256i begin = _mm256_sub_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(rows.begin + r)), before);
    __m256i end = _mm256_sub_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(rows.end + r)), before);
    end = _mm256_and_si256(kept, end);  // ends at 0: no bit
    for (std::uint32_t w = within[0]; w <= within[1]; ++w) {
      const __m256i from_begin = _mm256_sllv_epi32(all, _mm256_max_epi32(begin, none));
      const __m256i from_end = _mm256_sllv_epi32(all, _mm256_max_epi32(end, none));
      auto* const at = reinterpret_cast<__m256i*>(words + std::size_t{w} * kBeadBandRows + r);
      _mm256_storeu_si256(at, _mm256_or_si256(_mm256_loadu_si256(at), _mm256_andnot_si256(from_end, from_begin)));
      begin = _mm256_sub_epi32(begin, step);
      end = _mm256_sub_epi32(end, step);
    }
  }
}

/// Words from which on and up to which the bits of some rows of a line are.
LAMINA_BODY std::array<std::uint32_t, 2> words_of(const BeadLine& line, std::uint32_t first, std::uint32_t last) {
  const std::uint32_t up = first * line.step, down = last * line.step;
  const std::uint32_t low = std::min(line.from + up, line.from + down) >> kBeadLineBits;
  const std::uint32_t high = std::max(line.to + up, line.to + down) >> kBeadLineBits;
  return {low / kBeadWordBits, high / kBeadWordBits};
}

LAMINA_AVX2 std::uint64_t line_avx2(const BeadLine& line, std::uint32_t first, std::uint32_t last, std::uint32_t* words,
                                    std::uint8_t* touched) {
  constexpr std::uint32_t kRows = 8;
  const __m256i all = _mm256_set1_epi32(-1), none = _mm256_setzero_si256();
  const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7),
                tolerance = _mm256_set1_epi32(static_cast<int>(line.tolerance));
  const __m256i count = _mm256_set1_epi32(static_cast<int>(last - first));
  std::uint64_t undecided = 0;
  for (std::uint32_t r = first / kRows * kRows; r < last; r += kRows) {
    const __m256i row = _mm256_add_epi32(lanes, _mm256_set1_epi32(static_cast<int>(r - first)));  // of the line
    const __m256i by = _mm256_mullo_epi32(row, _mm256_set1_epi32(static_cast<int>(line.step)));
    const __m256i from = _mm256_add_epi32(by, _mm256_set1_epi32(static_cast<int>(line.from)));
    const __m256i to = _mm256_add_epi32(by, _mm256_set1_epi32(static_cast<int>(line.to)));
    const __m256i near =
        _mm256_min_epu32(_mm256_slli_epi32(from, 32 - kBeadLineBits), _mm256_slli_epi32(to, 32 - kBeadLineBits));
    const __m256i sure = _mm256_cmpeq_epi32(_mm256_max_epu32(near, tolerance), near);
    const __m256i within = _mm256_andnot_si256(_mm256_cmpgt_epi32(none, row), _mm256_cmpgt_epi32(count, row));
    const __m256i unsure = _mm256_andnot_si256(sure, within), kept = _mm256_and_si256(sure, within);
    undecided |= std::uint64_t{static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(unsure)))} << r;
    const auto [low, high] = words_of(line, std::max(r, first) - first, std::min(r + kRows, last) - 1 - first);
    const __m256i before = _mm256_set1_epi32(static_cast<int>(low * kBeadWordBits)), step = _mm256_set1_epi32(kBeadWordBits);
    __m256i begin = _mm256_sub_epi32(_mm256_srli_epi32(from, kBeadLineBits), before);
    __m256i end = _mm256_sub_epi32(_mm256_srli_epi32(to, kBeadLineBits), before);
    for (std::uint32_t w = line.first_word + low; w <= line.first_word + high; ++w) {
      const __m256i from_begin = _mm256_sllv_epi32(kept, _mm256_max_epi32(begin, none));
      const __m256i from_end = _mm256_sllv_epi32(all, _mm256_max_epi32(end, none));
      auto* const at = reinterpret_cast<__m256i*>(words + std::size_t{w} * kBeadBandRows + r);
      _mm256_storeu_si256(at, _mm256_or_si256(_mm256_loadu_si256(at), _mm256_andnot_si256(from_end, from_begin)));
      touched[w] = 1;
      begin = _mm256_sub_epi32(begin, step);
      end = _mm256_sub_epi32(end, step);
    }
  }
  return undecided;
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
  return columns_body<Eight>(bead, first, last, rows);
}

LAMINA_AVX512 std::uint64_t line_avx512(const BeadLine& line, std::uint32_t first, std::uint32_t last, std::uint32_t* words,
                                        std::uint8_t* touched) {
  constexpr std::uint32_t kRows = 16;
  const __m512i none = _mm512_setzero_si512(), step = _mm512_set1_epi32(kBeadWordBits), all = _mm512_set1_epi32(-1);
  const __m512i tolerance = _mm512_set1_epi32(static_cast<int>(line.tolerance));
  std::uint32_t r = first / kRows * kRows;
  const __m512i row = _mm512_add_epi32(_mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15),
                                       _mm512_set1_epi32(static_cast<int>(r - first)));  // of the line
  const __m512i by = _mm512_mullo_epi32(row, _mm512_set1_epi32(static_cast<int>(line.step)));
  const __m512i further = _mm512_set1_epi32(static_cast<int>(kRows * line.step));
  __m512i from = _mm512_add_epi32(by, _mm512_set1_epi32(static_cast<int>(line.from)));
  __m512i to = _mm512_add_epi32(by, _mm512_set1_epi32(static_cast<int>(line.to)));
  std::uint64_t undecided = 0;
  for (; r < last; r += kRows) {
    std::uint32_t lanes = r < first ? 0xFFFFu << (first - r) & 0xFFFFu : 0xFFFFu;
    if (r + kRows > last) lanes &= 0xFFFFu >> (r + kRows - last);
    const __m512i near =
        _mm512_min_epu32(_mm512_slli_epi32(from, 32 - kBeadLineBits), _mm512_slli_epi32(to, 32 - kBeadLineBits));
    const std::uint32_t unsure = _mm512_cmplt_epu32_mask(near, tolerance) & lanes;
    undecided |= std::uint64_t{unsure} << r;
    const auto kept = static_cast<__mmask16>(lanes & ~unsure);
    const auto [low, high] = words_of(line, std::max(r, first) - first, std::min(r + kRows, last) - 1 - first);
    const __m512i before = _mm512_set1_epi32(static_cast<int>(low * kBeadWordBits));
    __m512i begin = _mm512_sub_epi32(_mm512_srli_epi32(from, kBeadLineBits), before);
    __m512i end = _mm512_sub_epi32(_mm512_srli_epi32(to, kBeadLineBits), before);
    from = _mm512_add_epi32(from, further);
    to = _mm512_add_epi32(to, further);
    for (std::uint32_t w = line.first_word + low; w <= line.first_word + high; ++w) {
      const __m512i from_begin = _mm512_maskz_sllv_epi32(kept, all, _mm512_max_epi32(begin, none));
      const __m512i from_end = _mm512_sllv_epi32(all, _mm512_max_epi32(end, none));
      std::uint32_t* const at = words + std::size_t{w} * kBeadBandRows + r;
      _mm512_storeu_si512(at, _mm512_or_si512(_mm512_loadu_si512(at), _mm512_andnot_si512(from_end, from_begin)));
      touched[w] = 1;
      begin = _mm512_sub_epi32(begin, step);
      end = _mm512_sub_epi32(end, step);
    }
  }
  return undecided;
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
  static constexpr BeadKernels kPlain{columns_plain, set_plain, nullptr, changes_plain};
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr BeadKernels kAvx2{columns_avx2, set_avx2, line_avx2, changes_avx2};
  static constexpr BeadKernels kAvx512{columns_avx512, set_avx2, line_avx512, changes_avx512};
  if (isa == Isa::kAvx512) return kAvx512;
  if (isa == Isa::kAvx2) return kAvx2;
#endif
  return kPlain;
}

}  // namespace lamina::raster
