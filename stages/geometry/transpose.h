// stages/geometry/transpose.h: squares of bits, turned over.
#pragma once

#include <cstdint>

namespace lamina {
namespace transpose_detail {

template <unsigned kWidth>
inline void swap_across(std::uint64_t (&words)[64]) {
  // As many low bits of every 2 kWidth as are swapped.
  constexpr std::uint64_t kMask = ~std::uint64_t{0} / ((std::uint64_t{1} << (kWidth - 1) << 1) + 1);
  for (unsigned base = 0; base < 64; base += 2 * kWidth) {
    for (unsigned i = base; i < base + kWidth; ++i) {
      const std::uint64_t swapped = (words[i] >> kWidth ^ words[i + kWidth]) & kMask;
      words[i + kWidth] ^= swapped;
      words[i] ^= swapped << kWidth;
    }
  }
}

}  // namespace transpose_detail

/// Bit j of word i goes to bit i of word j. Blocks of 32, 16, ... 1 are swapped across the diagonal.
/// source  Warren, "Hacker's Delight", 2nd edition, section 7-3 (2012)
/// cost    about 150 ns
inline void transpose_square(std::uint64_t (&words)[64]) {
  using namespace transpose_detail;
  swap_across<32>(words);
  swap_across<16>(words);
  swap_across<8>(words);
  swap_across<4>(words);
  swap_across<2>(words);
  swap_across<1>(words);
}

}  // namespace lamina
