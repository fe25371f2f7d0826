// The census of eight facets at a time with AVX-512.
//
// Whole numbers modulo 2^64 only, the same in each lane as plain::census() takes; full products are put together from four of
// half the width.
#include "stages/load/kernels/kernels.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#include <bit>

#define LAMINA_INLINE LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::load::avx512 {
namespace {

LAMINA_INLINE __m512i all(std::uint64_t v) { return _mm512_set1_epi64(static_cast<long long>(v)); }

/// Of all lanes, which wrap as unsigned numbers do; the compiler's own sum adds signed ones.
LAMINA_INLINE std::uint64_t total(__m512i v) {
  std::uint64_t lane[8], sum = 0;
  _mm512_storeu_si512(lane, v);
  for (const std::uint64_t one : lane) sum += one;
  return sum;
}

/// Shuffles take the upper halves where shifts would do, too: they do not wait for the multiplier.
LAMINA_INLINE __m512i fold_eight(__m512i a, __m512i b) {
  const __m512i a_high = _mm512_shuffle_epi32(a, _MM_PERM_DDBB), b_high = _mm512_shuffle_epi32(b, _MM_PERM_DDBB);
  const __m512i low = _mm512_mul_epu32(a, b), one = _mm512_mul_epu32(a_high, b), other = _mm512_mul_epu32(a, b_high);
  const __m512i middle = _mm512_add_epi64(one, _mm512_srli_epi64(low, 32));
  const __m512i carried = _mm512_add_epi64(other, _mm512_and_si512(middle, all(UINT32_MAX)));
  const __m512i high = _mm512_add_epi64(_mm512_add_epi64(_mm512_mul_epu32(a_high, b_high), _mm512_srli_epi64(middle, 32)),
                                        _mm512_srli_epi64(carried, 32));
  return _mm512_xor_si512(_mm512_mask_shuffle_epi32(low, 0xAAAA, carried, _MM_PERM_CCAA), high);
}

LAMINA_INLINE __m512i words(const Nm* from) {
  return _mm512_cvtepu32_epi64(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)));
}

LAMINA_INLINE __m512i hash_eight(const Nm* x, const Nm* y, const Nm* z) {
  const __m512i xy = _mm512_or_si512(words(x), _mm512_slli_epi64(words(y), 32));
  return fold_eight(_mm512_xor_si512(xy, all(kA)), _mm512_xor_si512(_mm512_mullo_epi64(words(z), all(kD)), all(kB)));
}

/// As hashed_area(): differences of 31 bits have a sign in 32.
LAMINA_INLINE __m512i areas(__m512i a, __m512i b, __m512i c) {
  const __m512i bits = all(0x7fffffff);
  const __m512i ax = _mm512_and_si512(a, bits), ay = _mm512_srli_epi64(a, 33);
  const __m512i ux = _mm512_sub_epi64(_mm512_and_si512(b, bits), ax), uy = _mm512_sub_epi64(_mm512_srli_epi64(b, 33), ay);
  const __m512i vx = _mm512_sub_epi64(_mm512_and_si512(c, bits), ax), vy = _mm512_sub_epi64(_mm512_srli_epi64(c, 33), ay);
  return _mm512_sub_epi64(_mm512_mul_epi32(ux, vy), _mm512_mul_epi32(vx, uy));
}

LAMINA_INLINE __mmask8 either(__mmask8 one, __mmask8 other) { return static_cast<__mmask8>(one ^ other); }

/// As sample() of those lanes. returns  how many are facets
LAMINA_INLINE std::uint32_t sample_lanes(__mmask8 lanes, __m512i facet, const __m512i (&corner)[3], std::uint64_t* to) {
  const __m512i a = corner[0], b = corner[1], c = corner[2];
  const __mmask8 apart =
      _mm512_mask_cmpneq_epi64_mask(_mm512_mask_cmpneq_epi64_mask(_mm512_mask_cmpneq_epi64_mask(lanes, a, b), b, c), c, a);
  const __mmask8 turned =
      either(either(_mm512_cmplt_epu64_mask(a, b), _mm512_cmplt_epu64_mask(b, c)), _mm512_cmplt_epu64_mask(c, a));
  const __m512i odd = _mm512_or_si512(_mm512_mullo_epi64(facet, all(kB)), all(1));
  _mm512_storeu_si512(to, _mm512_maskz_compress_epi64(apart, _mm512_mask_xor_epi64(odd, turned, odd, all(1))));
  return static_cast<std::uint32_t>(std::popcount(static_cast<unsigned>(apart)));
}

}  // namespace

void census(SortedBlock& block, std::uint64_t share, CensusSums& sums) {
  const __m512i below = all(UINT64_MAX / share), to_b = all(kB), to_c = all(kC);
  __m512i boundary = _mm512_setzero_si512(), fingerprint = boundary;
  std::uint64_t sampled[kBlockSize + 8];  // unset; a store writes 8
  std::uint32_t samples = 0;
  for (std::uint32_t first = 0; first < block.clusters() * kClusterSize; first += 8) {
    const std::uint32_t lane = first % kClusterSize, left = block.triangles - std::min(block.triangles, first);
    const auto used = static_cast<__mmask8>(left >= 8 ? 255u : (1u << left) - 1);
    const auto& [z, y, x] = block.cluster[first / kClusterSize];
    __m512i corner[3];
    for (std::uint32_t k = 0; k < 3; ++k) {
      corner[k] = hash_eight(x[k] + lane, y[k] + lane, z[k] + lane);
      std::uint16_t* const to = block.hash.data() + first / kClusterSize * SortedBlock::kCorners + k * kClusterSize + lane;
      _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm512_cvtepi64_epi16(_mm512_srli_epi64(corner[k], 48)));
    }
    const __m512i a = corner[0], b = corner[1], c = corner[2];
    const __m512i from_a = _mm512_xor_si512(a, to_c), from_b = _mm512_xor_si512(b, to_c), from_c = _mm512_xor_si512(c, to_c);
    const __m512i to_a = _mm512_xor_si512(a, to_b), at_b = _mm512_xor_si512(b, to_b), at_c = _mm512_xor_si512(c, to_b);
    const __m512i forward =
        _mm512_add_epi64(_mm512_add_epi64(fold_eight(from_a, at_b), fold_eight(from_b, at_c)), fold_eight(from_c, to_a));
    boundary = _mm512_add_epi64(boundary, areas(a, b, c));
    fingerprint =
        _mm512_mask_add_epi64(fingerprint, used, fingerprint, fold_eight(_mm512_xor_si512(forward, all(kA)), all(kD)));
    const __m512i facet = _mm512_add_epi64(_mm512_add_epi64(a, b), c);
    const __mmask8 chosen = _mm512_mask_cmple_epu64_mask(used, facet, below);
    if (chosen != 0) samples += sample_lanes(chosen, facet, corner, sampled + samples);
  }
  sums.sampled.insert(sums.sampled.end(), sampled, sampled + samples);
  sums.boundary += total(boundary);
  sums.fingerprint += total(fingerprint);
}

}  // namespace lamina::load::avx512

LAMINA_AVX512_END

#undef LAMINA_INLINE
#endif
