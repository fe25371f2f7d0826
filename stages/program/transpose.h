// stages/program/transpose.h: squares of bits.
#pragma once

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <array>
#include <cstdint>

#include "stages/geometry/targets.h"

namespace lamina::program {

/// Swaps blocks of `width` across the diagonal.
template <unsigned width>
LAMINA_BODY void swap_blocks(std::uint64_t (&words)[64]) {
  constexpr std::uint64_t kMask = ~std::uint64_t{0} / ((std::uint64_t{1} << width) + 1);
  for (unsigned base = 0; base < 64; base += 2 * width) {
    for (unsigned i = base; i < base + width; ++i) {
      const std::uint64_t swapped = (words[i] >> width ^ words[i + width]) & kMask;
      words[i + width] ^= swapped;
      words[i] ^= swapped << width;
    }
  }
}

/// Bit j of word i goes to bit i of word j.
/// source  Warren, "Hacker's Delight", 2nd edition, section 7-3 (2012)
LAMINA_BODY void transpose_64x64(std::uint64_t (&words)[64]) {
  swap_blocks<32>(words);
  swap_blocks<16>(words);
  swap_blocks<8>(words);
  swap_blocks<4>(words);
  swap_blocks<2>(words);
  swap_blocks<1>(words);
}

#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX512_BEGIN
/// The same. Bytes are collected by columns, and then bit after bit of 64 of them is a word.
LAMINA_AVX512 inline void transpose_64x64_avx512(std::uint64_t (&words)[64]) {
  alignas(64) static constexpr auto kPairs = [] {  // bytes 0, 8, 1, 9, ... of each 16
    std::array<std::uint8_t, 64> order{};
    for (unsigned i = 0; i < 64; ++i) order[i] = static_cast<std::uint8_t>(i % 2 * 8 + i % 16 / 2);
    return order;
  }();
  alignas(64) static constexpr auto kColumns = [] {  // word j of each quarter together
    std::array<std::uint16_t, 32> order{};
    for (unsigned i = 0; i < 32; ++i) order[i] = static_cast<std::uint16_t>(i % 4 * 8 + i / 4);
    return order;
  }();
  const __m512i pairs = _mm512_load_si512(kPairs.data()), columns = _mm512_load_si512(kColumns.data());
  __m512i row[8], half[8];
  for (unsigned k = 0; k < 8; ++k) {  // qword j of row[k]: byte j of the words 8 k, 8 k + 1, ...
    row[k] = _mm512_permutexvar_epi16(columns, _mm512_shuffle_epi8(_mm512_loadu_si512(words + 8 * k), pairs));
  }
  for (unsigned k = 0; k < 8; k += 2) {
    half[k] = _mm512_unpacklo_epi64(row[k], row[k + 1]);
    half[k + 1] = _mm512_unpackhi_epi64(row[k], row[k + 1]);
  }
  for (unsigned odd = 0; odd < 2; ++odd) {
    const __m512i a = _mm512_shuffle_i64x2(half[odd], half[odd + 2], 0x88),
                  b = _mm512_shuffle_i64x2(half[odd], half[odd + 2], 0xDD);
    const __m512i c = _mm512_shuffle_i64x2(half[odd + 4], half[odd + 6], 0x88),
                  d = _mm512_shuffle_i64x2(half[odd + 4], half[odd + 6], 0xDD);
    row[odd] = _mm512_shuffle_i64x2(a, c, 0x88);
    row[odd + 4] = _mm512_shuffle_i64x2(a, c, 0xDD);
    row[odd + 2] = _mm512_shuffle_i64x2(b, d, 0x88);
    row[odd + 6] = _mm512_shuffle_i64x2(b, d, 0xDD);
  }
  for (unsigned j = 0; j < 8; ++j) {
    for (unsigned bit = 8; bit-- > 0;) {
      words[8 * j + bit] = _mm512_movepi8_mask(row[j]);
      row[j] = _mm512_add_epi8(row[j], row[j]);
    }
  }
}
LAMINA_AVX512_END
#endif

}  // namespace lamina::program
