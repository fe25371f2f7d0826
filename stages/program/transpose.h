// stages/program/transpose.h: squares of bits.
#pragma once

#include <cstdint>

#include "stages/geometry/targets.h"

namespace lamina::program {

/// Bit j of word i goes to bit i of word j. Blocks of 32, 16, ... 1 are swapped across the diagonal.
/// source  Warren, "Hacker's Delight", 2nd edition, section 7-3 (2012)
LAMINA_BODY void transpose_64x64(std::uint64_t (&words)[64]) {
  std::uint64_t mask = 0x00000000FFFFFFFFull;
  for (unsigned width = 32; width != 0; width >>= 1, mask ^= mask << width) {
    for (unsigned base = 0; base < 64; base += 2 * width) {
      for (unsigned i = base; i < base + width; ++i) {
        const std::uint64_t swapped = (words[i] >> width ^ words[i + width]) & mask;
        words[i + width] ^= swapped;
        words[i] ^= swapped << width;
      }
    }
  }
}

}  // namespace lamina::program
