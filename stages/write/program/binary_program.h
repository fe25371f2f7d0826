// stages/write/program/binary_program.h: what binary dialects have in common: little-endian numbers and segments.
#pragma once

#include <bit>
#include <cstring>
#include <type_traits>

#include "stages/write/program/dialect.h"

namespace lamina::write {

/// Appends a whole number, lowest byte first.
template <class Integer>
void put_little(ProgramBytes& out, std::type_identity_t<Integer> value) {
  const std::size_t at = out.size();
  out.resize(at + sizeof(Integer));
  for (std::size_t byte = 0; byte < sizeof(Integer); ++byte) {
    out[at + byte] = static_cast<std::byte>(static_cast<std::make_unsigned_t<Integer>>(value) >> (8 * byte) & 255);
  }
}

/// Appends four letters.
inline void put_tag(ProgramBytes& out, const char (&tag)[5]) {
  for (int i = 0; i < 4; ++i) out.push_back(static_cast<std::byte>(tag[i]));
}

/// Calls visit(place, count) for stretches of steps without a gap of zeros that would cost more than a segment's head:
/// places count from the first step of the vectors, in increasing order.
template <class Visit>
void for_each_segment(const SweepVectors& vectors, std::size_t head_bytes, std::size_t vector_bytes, const Visit& visit) {
  const std::uint32_t widest_gap = static_cast<std::uint32_t>(head_bytes / vector_bytes);
  const auto fires = [&](std::uint32_t place) {
    const std::uint64_t* words = vectors.bits.data() + std::size_t{place} * vectors.words;
    std::uint64_t any = 0;
    for (std::uint32_t w = 0; w < vectors.words; ++w) any |= words[w];
    return any != 0;
  };
  std::uint32_t begin = 0, last = 0;  // the first and the last step of the stretch fire: so do those of the vectors
  for (std::uint32_t place = 1; place < vectors.steps; ++place) {
    if (!fires(place)) continue;
    if (place - last - 1 > widest_gap) {
      visit(begin, last + 1 - begin);
      begin = place;
    }
    last = place;
  }
  visit(begin, last + 1 - begin);
}

/// The word with its bits in the opposite order.
inline std::uint64_t reversed(std::uint64_t word) {
  word = (word >> 1 & 0x5555555555555555ull) | (word & 0x5555555555555555ull) << 1;
  word = (word >> 2 & 0x3333333333333333ull) | (word & 0x3333333333333333ull) << 2;
  word = (word >> 4 & 0x0F0F0F0F0F0F0F0Full) | (word & 0x0F0F0F0F0F0F0F0Full) << 4;
  return __builtin_bswap64(word);
}

/// The position of nozzle 0 across the scan, of the carriage in nm.
inline std::int64_t across_nm(const Machine& machine, const HeadGrid& grid, std::int64_t line) {
  const double offset = machine.mounting.offset_mm[grid.scan_axis == ScanAxis::kX ? 1 : 0] * kNmPerMm;
  const double nm = grid.line_position_nm(line) + offset;
  return static_cast<std::int64_t>(nm + (nm < 0 ? -0.5 : 0.5));
}

}  // namespace lamina::write
