// The census of four facets at a time with AVX2.
//
// Whole numbers modulo 2^64 only, the same in each lane as plain::census() takes; full products are put together from four of
// half the width.
#include "stages/load/kernels/kernels.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_INLINE LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::load::avx2 {
namespace {

constexpr std::uint32_t kLanes = 4;

LAMINA_INLINE __m256i all(std::uint64_t v) { return _mm256_set1_epi64x(static_cast<long long>(v)); }

/// The low 64 bits of products.
LAMINA_INLINE __m256i product(__m256i a, __m256i b) {
  const __m256i crossed =
      _mm256_add_epi64(_mm256_mul_epu32(_mm256_srli_epi64(a, 32), b), _mm256_mul_epu32(a, _mm256_srli_epi64(b, 32)));
  return _mm256_add_epi64(_mm256_mul_epu32(a, b), _mm256_slli_epi64(crossed, 32));
}

/// Shuffles take the upper halves where shifts would do, too: they do not wait for the multiplier.
LAMINA_INLINE __m256i fold_four(__m256i a, __m256i b) {
  const __m256i a_high = _mm256_shuffle_epi32(a, 0xF5), b_high = _mm256_shuffle_epi32(b, 0xF5);
  const __m256i low = _mm256_mul_epu32(a, b), one = _mm256_mul_epu32(a_high, b), other = _mm256_mul_epu32(a, b_high);
  const __m256i middle = _mm256_add_epi64(one, _mm256_srli_epi64(low, 32));
  const __m256i carried = _mm256_add_epi64(other, _mm256_and_si256(middle, all(UINT32_MAX)));
  const __m256i high = _mm256_add_epi64(_mm256_add_epi64(_mm256_mul_epu32(a_high, b_high), _mm256_srli_epi64(middle, 32)),
                                        _mm256_srli_epi64(carried, 32));
  return _mm256_xor_si256(_mm256_blend_epi32(low, _mm256_shuffle_epi32(carried, 0xA0), 0xAA), high);
}

LAMINA_INLINE __m256i words(const Nm* from) {
  return _mm256_cvtepu32_epi64(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from)));
}

LAMINA_INLINE __m256i hash_four(const Nm* x, const Nm* y, const Nm* z) {
  const __m256i xy = _mm256_or_si256(words(x), _mm256_slli_epi64(words(y), 32));
  return fold_four(_mm256_xor_si256(xy, all(kA)), _mm256_xor_si256(product(words(z), all(kD)), all(kB)));
}

/// As hashed_area(): differences of 31 bits have a sign in 32.
LAMINA_INLINE __m256i areas(__m256i a, __m256i b, __m256i c) {
  const __m256i bits = all(0x7fffffff);
  const __m256i ax = _mm256_and_si256(a, bits), ay = _mm256_srli_epi64(a, 33);
  const __m256i ux = _mm256_sub_epi64(_mm256_and_si256(b, bits), ax), uy = _mm256_sub_epi64(_mm256_srli_epi64(b, 33), ay);
  const __m256i vx = _mm256_sub_epi64(_mm256_and_si256(c, bits), ax), vy = _mm256_sub_epi64(_mm256_srli_epi64(c, 33), ay);
  return _mm256_sub_epi64(_mm256_mul_epi32(ux, vy), _mm256_mul_epi32(vx, uy));
}

/// The upper 16 bits of each word.
LAMINA_INLINE void put_hashes(__m256i hashes, std::uint16_t* to) {
  const __m256i words_first =
      _mm256_shuffle_epi8(hashes, _mm256_setr_epi8(6, 7, 14, 15, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
                                                   6, 7, 14, 15, -1, -1, -1, -1, -1, -1, -1, -1));
  const __m128i four = _mm_or_si128(_mm256_castsi256_si128(words_first), _mm256_extracti128_si256(words_first, 1));
  _mm_storel_epi64(reinterpret_cast<__m128i*>(to), four);
}

LAMINA_INLINE std::uint64_t total(__m256i v) {
  std::uint64_t lane[kLanes];
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(lane), v);
  return lane[0] + lane[1] + lane[2] + lane[3];
}

LAMINA_INLINE __m256i less(__m256i one, __m256i other) {
  const __m256i sign = all(std::uint64_t{1} << 63);
  return _mm256_cmpgt_epi64(_mm256_xor_si256(other, sign), _mm256_xor_si256(one, sign));
}

/// As sample() of those lanes. returns  how many are facets
LAMINA_INLINE std::uint32_t sample_lanes(__m256i lanes, __m256i facet, const __m256i (&corner)[3], std::uint64_t* to) {
  const __m256i a = corner[0], b = corner[1], c = corner[2];
  const __m256i together =
      _mm256_or_si256(_mm256_or_si256(_mm256_cmpeq_epi64(a, b), _mm256_cmpeq_epi64(b, c)), _mm256_cmpeq_epi64(c, a));
  const __m256i turned = _mm256_xor_si256(_mm256_xor_si256(less(a, b), less(b, c)), less(c, a));
  std::uint64_t value[kLanes];
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(value),
                      _mm256_xor_si256(_mm256_or_si256(product(facet, all(kB)), all(1)), _mm256_and_si256(turned, all(1))));
  const auto used = static_cast<unsigned>(_mm256_movemask_pd(_mm256_castsi256_pd(_mm256_andnot_si256(together, lanes))));
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < kLanes; ++i) {
    to[count] = value[i];
    count += used >> i & 1;
  }
  return count;
}

}  // namespace

void census(SortedBlock& block, std::uint64_t share, CensusSums& sums) {
  const std::uint64_t below = UINT64_MAX / share;
  const __m256i sign = all(std::uint64_t{1} << 63), bound = _mm256_xor_si256(all(below), sign), to_b = all(kB), to_c = all(kC);
  const __m256i lanes = _mm256_set_epi64x(3, 2, 1, 0);
  __m256i boundary = _mm256_setzero_si256(), fingerprint = boundary;
  std::uint64_t sampled[kBlockSize + kLanes];  // unset; four are written at once
  std::uint32_t samples = 0;
  for (std::uint32_t first = 0; first < block.clusters() * kClusterSize; first += kLanes) {
    const std::uint32_t lane = first % kClusterSize, left = block.triangles - std::min(block.triangles, first);
    const __m256i used = _mm256_cmpgt_epi64(all(left), lanes);
    const auto& [z, y, x] = block.cluster[first / kClusterSize];
    __m256i corner[3];
    for (std::uint32_t k = 0; k < 3; ++k) {
      corner[k] = hash_four(x[k] + lane, y[k] + lane, z[k] + lane);
      put_hashes(corner[k], block.hash.data() + first / kClusterSize * SortedBlock::kCorners + k * kClusterSize + lane);
    }
    const __m256i a = corner[0], b = corner[1], c = corner[2];
    const __m256i from_a = _mm256_xor_si256(a, to_c), from_b = _mm256_xor_si256(b, to_c), from_c = _mm256_xor_si256(c, to_c);
    const __m256i at_a = _mm256_xor_si256(a, to_b), at_b = _mm256_xor_si256(b, to_b), at_c = _mm256_xor_si256(c, to_b);
    const __m256i forward =
        _mm256_add_epi64(_mm256_add_epi64(fold_four(from_a, at_b), fold_four(from_b, at_c)), fold_four(from_c, at_a));
    boundary = _mm256_add_epi64(boundary, areas(a, b, c));
    fingerprint = _mm256_add_epi64(fingerprint, _mm256_and_si256(used, fold_four(_mm256_xor_si256(forward, all(kA)), all(kD))));
    const __m256i facet = _mm256_add_epi64(_mm256_add_epi64(a, b), c);
    const __m256i beyond = _mm256_cmpgt_epi64(_mm256_xor_si256(facet, sign), bound);
    if (_mm256_movemask_epi8(beyond) != -1) {
      samples += sample_lanes(_mm256_andnot_si256(beyond, used), facet, corner, sampled + samples);
    }
  }
  sums.sampled.insert(sums.sampled.end(), sampled, sampled + samples);
  sums.boundary += total(boundary);
  sums.fingerprint += total(fingerprint);
}

}  // namespace lamina::load::avx2

#undef LAMINA_INLINE
#endif
