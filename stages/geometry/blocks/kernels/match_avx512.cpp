// Corners are matched and numbered 16 at a time with AVX-512.
//
// Whole numbers only: each lane reads and compares the same as plain::match(), and numbers are counted in the order of lanes.
#include "stages/geometry/blocks/kernels/kernels.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#include <algorithm>
#include <bit>

#define LAMINA_INLINE LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::avx512 {
namespace {

constexpr std::uint32_t kLanes = 16;

LAMINA_INLINE __m512i lanes_from(std::uint32_t first) {
  return _mm512_add_epi32(_mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0),
                          _mm512_set1_epi32(static_cast<int>(first)));
}

LAMINA_INLINE __m512i load_shorts(const std::uint16_t* from) {
  return _mm512_cvtepu16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)));
}

LAMINA_INLINE void store_shorts(std::uint16_t* to, __m512i v) {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm512_cvtepi32_epi16(v));
}

/// Numbers of 16 bits, of which a gather reads 32.
LAMINA_INLINE __m512i gather_shorts(const std::uint16_t* table, __m512i index) {
  return _mm512_and_si512(_mm512_i32gather_epi32(index, table, 2), _mm512_set1_epi32(0xFFFF));
}

/// Where the z of corners lie: 96 numbers further for each cluster before them. Times 43691 / 2^21 is divided by 48, exactly
/// below 2^16.
LAMINA_INLINE __m512i slots_of(__m512i corner) {
  const __m512i cluster = _mm512_srli_epi32(_mm512_mulhi_epu16(corner, _mm512_set1_epi32(43691)), 5);
  return _mm512_add_epi32(corner, _mm512_add_epi32(_mm512_slli_epi32(cluster, 6), _mm512_slli_epi32(cluster, 5)));
}

LAMINA_INLINE __mmask16 other_than(const Nm* own, __m512i position, const Nm* coordinates) {
  return _mm512_cmpneq_epi32_mask(_mm512_loadu_si512(own), _mm512_i32gather_epi32(position, coordinates, 4));
}

/// Where the numbers of 16 vertices in a row come from, 16 at a time: x and y are lanes 0 to 15 and 16 to 31 of two registers.
struct Weave {
  alignas(64) std::int32_t of_xy[3][kLanes] = {};
  alignas(64) std::int32_t of_z[3][kLanes] = {};
  std::uint16_t is_z[3] = {};

  constexpr Weave() {
    for (std::uint32_t n = 0; n < 3 * kLanes; ++n) {
      const std::uint32_t part = n / kLanes, lane = n % kLanes, vertex = n / 3;
      of_xy[part][lane] = static_cast<std::int32_t>(n % 3 == 1 ? vertex + kLanes : vertex);
      of_z[part][lane] = static_cast<std::int32_t>(vertex);
      if (n % 3 == 2) is_z[part] = static_cast<std::uint16_t>(is_z[part] | 1u << lane);
    }
  }
};

}  // namespace

void match(const SortedBlock& block, CornerMatches& matches) {
  constexpr std::uint32_t kY = SortedBlock::kCorners, kX = 2 * SortedBlock::kCorners;
  const Nm* const base = corner_at(block, 0);
  std::uint32_t rest = 0, found = 0;
  for (std::uint32_t c = 0, i = 0; c < block.clusters(); ++c) {
    const Nm* corner = corner_at(block, i);
    for (std::uint32_t k = 0; k < 3; ++k, i += kLanes, corner += kLanes) {
      const __m512i slot = _mm512_and_si512(load_shorts(block.hash.data() + i), _mm512_set1_epi32(CornerMatches::kSlots - 1));
      const __m512i first = gather_shorts(matches.slot.data(), slot), position = slots_of(first), own = lanes_from(i);
      const auto other =
          static_cast<__mmask16>(other_than(corner, position, base) | other_than(corner + kY, position, base + kY) |
                                 other_than(corner + kX, position, base + kX));
      store_shorts(matches.first.data() + i, first);
      store_shorts(matches.rest.data() + rest, _mm512_maskz_compress_epi32(other, own));
      rest += static_cast<std::uint32_t>(std::popcount(static_cast<unsigned>(other)));
      found += static_cast<std::uint32_t>(std::popcount(static_cast<unsigned>(_mm512_cmpeq_epi32_mask(first, own))));
    }
  }
  matches.unmatched = rest;
  matches.found = found;
}

std::uint32_t number(std::uint32_t corners, CornerMatches& matches) {
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < corners; i += kLanes) {
    const __m512i own = lanes_from(i);
    const __mmask16 is_new = _mm512_cmpeq_epi32_mask(load_shorts(matches.first.data() + i), own);
    store_shorts(matches.number.data() + i, _mm512_maskz_expand_epi32(is_new, lanes_from(count)));
    store_shorts(matches.vertex.data() + count, _mm512_maskz_compress_epi32(is_new, own));
    count += static_cast<std::uint32_t>(std::popcount(static_cast<unsigned>(is_new)));
  }
  // Numbers are read where they were written for first corners, which have their own.
  for (std::uint32_t i = 0; i < corners; i += kLanes) {
    store_shorts(matches.number.data() + i, gather_shorts(matches.number.data(), load_shorts(matches.first.data() + i)));
  }
  return count;
}

void write(const SortedBlock& block, const CornerMatches& matches, std::uint32_t count, Point3* to) {
  constexpr std::uint32_t kY = SortedBlock::kCorners, kX = 2 * SortedBlock::kCorners;
  static constexpr Weave kWeave;
  const Nm* const base = corner_at(block, 0);
  for (std::uint32_t v = 0; v < count; v += kLanes) {
    const std::uint32_t here = std::min(count - v, kLanes);
    const auto used = static_cast<__mmask16>((1u << here) - 1);  // behind them nothing is set
    const __m512i position = slots_of(_mm512_maskz_mov_epi32(used, load_shorts(matches.vertex.data() + v)));
    const __m512i x = _mm512_i32gather_epi32(position, base + kX, 4), y = _mm512_i32gather_epi32(position, base + kY, 4),
                  z = _mm512_i32gather_epi32(position, base, 4);
    const std::uint64_t numbers = (std::uint64_t{1} << 3 * here) - 1;
    for (std::uint32_t part = 0; part < 3; ++part) {
      const __m512i xy = _mm512_permutex2var_epi32(x, _mm512_load_si512(kWeave.of_xy[part]), y);
      _mm512_mask_storeu_epi32(&to[v].x + part * kLanes, static_cast<__mmask16>(numbers >> part * kLanes),
                               _mm512_mask_permutexvar_epi32(xy, kWeave.is_z[part], _mm512_load_si512(kWeave.of_z[part]), z));
    }
  }
}

}  // namespace lamina::avx512

LAMINA_AVX512_END

#undef LAMINA_INLINE
#endif
