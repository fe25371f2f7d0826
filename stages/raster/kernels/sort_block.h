// stages/raster/kernels/sort_block.h: 2^n crossings in order, by networks that have no branch, for any processor.
#pragma once

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace lamina::raster::plain {

/// Batcher's merge-exchange network for 2^n values: pairs to put in order, one after the other.
template <std::size_t kSize>
constexpr auto comparisons() {
  struct List {
    std::array<std::pair<std::size_t, std::size_t>, kSize * 4> pair{};
    std::size_t count = 0;
  } list;
  for (std::size_t p = 1; p < kSize; p *= 2) {
    for (std::size_t k = p; k >= 1; k /= 2) {
      for (std::size_t j = k % p; j + k < kSize; j += 2 * k) {
        for (std::size_t i = 0; i < k && i + j + k < kSize; ++i) {
          if ((i + j) / (2 * p) == (i + j + k) / (2 * p)) list.pair[list.count++] = {i + j, i + j + k};
        }
      }
    }
  }
  return list;
}

/// Sorts kSize crossings.
template <std::size_t kSize>
void sort_block(std::uint32_t* at) {
  static constexpr auto kNetwork = comparisons<kSize>();
  std::uint32_t value[kSize];
  std::copy_n(at, kSize, value);
  [&]<std::size_t... i>(std::index_sequence<i...>) {
    const auto in_order = [](std::uint32_t& a, std::uint32_t& b) {
      const std::uint32_t low = b < a ? b : a;
      b ^= a ^ low;  // g++ 12 forgets to exchange two values at -O3 if this is a maximum
      a = low;
    };
    (in_order(value[kNetwork.pair[i].first], value[kNetwork.pair[i].second]), ...);
  }
  (std::make_index_sequence<kNetwork.count>());
  std::copy_n(value, kSize, at);
}

#if defined(__SSE2__)
/// Four crossings a register, less 2^31: SSE2 compares numbers with a sign.
struct Fours {
  static __m128i load(const std::uint32_t* at) {
    return _mm_xor_si128(_mm_loadu_si128(reinterpret_cast<const __m128i*>(at)), _mm_set1_epi32(INT32_MIN));
  }
  static void store(std::uint32_t* at, __m128i v) {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(at), _mm_xor_si128(v, _mm_set1_epi32(INT32_MIN)));
  }
  static __m128i reversed(__m128i v) { return _mm_shuffle_epi32(v, 0x1B); }

  /// The lesser of each lane into a, the greater into b.
  static void order(__m128i& a, __m128i& b) {
    const __m128i swap = _mm_and_si128(_mm_xor_si128(a, b), _mm_cmpgt_epi32(a, b));
    a = _mm_xor_si128(a, swap);
    b = _mm_xor_si128(b, swap);
  }

  /// Four registers, each of which is sorted then.
  static void sort_each(__m128i* v) {
    order(v[0], v[1]), order(v[2], v[3]), order(v[0], v[2]), order(v[1], v[3]), order(v[1], v[2]);
    const __m128i low = _mm_unpacklo_epi32(v[0], v[1]), low_2 = _mm_unpacklo_epi32(v[2], v[3]);
    const __m128i high = _mm_unpackhi_epi32(v[0], v[1]), high_2 = _mm_unpackhi_epi32(v[2], v[3]);
    v[0] = _mm_unpacklo_epi64(low, low_2), v[1] = _mm_unpackhi_epi64(low, low_2);
    v[2] = _mm_unpacklo_epi64(high, high_2), v[3] = _mm_unpackhi_epi64(high, high_2);
  }

  /// Two registers, each of which rises and then falls or the other way round, are sorted, each by itself.
  static void finish_two(__m128i& a, __m128i& b) {
    __m128i left = _mm_unpacklo_epi64(a, b), right = _mm_unpackhi_epi64(a, b);
    order(left, right);
    const __m128 low = _mm_castsi128_ps(left), high = _mm_castsi128_ps(right);
    __m128i even = _mm_castps_si128(_mm_shuffle_ps(low, high, 0x88)), odd = _mm_castps_si128(_mm_shuffle_ps(low, high, 0xDD));
    order(even, odd);  // lanes 0 of a, 0 of b, 2 of a, 2 of b, and those behind them
    const __m128i first = _mm_unpacklo_epi32(even, odd), second = _mm_unpackhi_epi32(even, odd);
    a = _mm_unpacklo_epi64(first, second);
    b = _mm_unpackhi_epi64(first, second);
  }

  /// Two sorted registers, merged.
  static void merge(__m128i& a, __m128i& b) {
    b = reversed(b);
    order(a, b);
    finish_two(a, b);
  }

  static void sort_sixteen(std::uint32_t* at) {
    __m128i v[4];
    for (std::size_t i = 0; i < 4; ++i) v[i] = load(at + 4 * i);
    sort_each(v);
    merge(v[0], v[1]);
    merge(v[2], v[3]);
    __m128i third = reversed(v[3]), fourth = reversed(v[2]);
    order(v[0], third), order(v[1], fourth);
    order(v[0], v[1]), order(third, fourth);
    finish_two(v[0], v[1]);
    finish_two(third, fourth);
    store(at, v[0]), store(at + 4, v[1]), store(at + 8, third), store(at + 12, fourth);
  }
};

template <>
inline void sort_block<16>(std::uint32_t* at) {
  Fours::sort_sixteen(at);
}
#endif

}  // namespace lamina::raster::plain
