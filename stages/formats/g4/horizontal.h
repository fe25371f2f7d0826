// stages/formats/g4/horizontal.h: T.6's horizontal mode, two runs by their lengths.
#pragma once

#include <cstdint>

#include "stages/formats/g4/bit_writer.h"

namespace lamina::formats::g4 {

struct RunWord {
  std::uint64_t bits;
  std::uint32_t length;
};

inline RunWord run_word(const RunCodes& codes, std::uint32_t run) {
  const Code make_up = codes.make_up[run >> 6], terminating = codes.terminating[run & 63];
  return {std::uint64_t{make_up.bits()} << terminating.length() | terminating.bits(), make_up.length() + terminating.length()};
}

/// The make-up code for 2560 `times` after each other, at most four of them.
constexpr RunWord longest_make_ups(std::uint32_t times) {
  constexpr Code kOne = kRunCodes[0].make_up[kLongestMakeUp / 64];  // of both colours
  std::uint64_t four = 0;
  for (int i = 0; i < 4; ++i) four = four << kOne.length() | kOne.bits();
  return {four & ((std::uint64_t{1} << times * kOne.length()) - 1), times * kOne.length()};
}

inline void put_run(BitWriter& writer, const RunCodes& codes, std::uint32_t run) {
  if (run >= kLongestMakeUp + 64) {
    std::uint32_t times = (run - 64) / kLongestMakeUp;  // leaves 64 .. 2623
    run -= times * kLongestMakeUp;
    for (; times > 4; times -= 4) writer.put(longest_make_ups(4).bits, longest_make_ups(4).length);
    const RunWord make_ups = longest_make_ups(times);
    writer.put(make_ups.bits, make_ups.length);
  }
  const RunWord word = run_word(codes, run);
  writer.put(word.bits, word.length);
}

/// `first` in the colour `black`, then `second` in the other.
inline void put_horizontal(BitWriter& writer, unsigned black, std::uint32_t first, std::uint32_t second) {
  const RunCodes &codes = kRunCodes[black], &other = kRunCodes[black ^ 1];
  if ((first | second) < 64) [[likely]] {
    const Code one = codes.terminating[first], two = other.terminating[second];
    const std::uint64_t bits = (std::uint64_t{kHorizontal.bits()} << one.length() | one.bits()) << two.length() | two.bits();
    writer.put(bits, kHorizontal.length() + one.length() + two.length());
  } else if ((first | second) < kLongestMakeUp) {
    const RunWord one = run_word(codes, first), two = run_word(other, second);
    const std::uint64_t bits = (std::uint64_t{kHorizontal.bits()} << one.length | one.bits) << two.length | two.bits;
    writer.put(bits, kHorizontal.length() + one.length + two.length);
  } else {
    writer.put(kHorizontal);
    put_run(writer, codes, first);
    put_run(writer, other, second);
  }
}

}  // namespace lamina::formats::g4
