// stages/program/binary_program.h: what binary dialects have in common: little-endian numbers and segments.
#pragma once

#include <bit>
#include <cstring>
#include <type_traits>

#include "stages/program/dialect.h"

namespace lamina::program {

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

/// The vats that feed a layer, a bit each.
inline std::uint32_t vat_bits(const LayerCycle& cycle) {
  std::uint32_t bits = 0;
  for (const std::uint32_t vat : cycle.feeds) bits |= 1u << vat;
  return bits;
}

/// Calls visit(place, count) for stretches of steps without a gap of zeros that would cost more than a segment's head:
/// places count from the first step of the vectors, in increasing order. cost  O(stretches that fire)
template <class Visit>
void for_each_segment(const SweepVectors& vectors, std::size_t head_bytes, std::size_t vector_bytes, const Visit& visit) {
  const std::size_t widest_gap = head_bytes / vector_bytes;
  const auto& firing = vectors.firing;
  for (std::size_t i = 0; i < firing.size();) {
    const std::uint32_t begin = firing[i];
    for (i += 2; i < firing.size() && firing[i] - firing[i - 1] <= widest_gap;) i += 2;
    visit(begin, firing[i - 1] - begin);
  }
}

/// Appends the segments of a sweep in the order of the movement: for each one its head, kHead bytes that
/// head(to, place, count) writes, and its vectors as they stand in `vectors.bits`, whose order is that of the dialect
/// (Dialect::bit_order), cut off at vector_bytes.
/// turn    vectors of a segment run downwards
/// planes  a step's vectors are so many, and a segment has those of all its steps plane after plane
template <std::size_t kHead, class Head>
void put_segments(const SweepVectors& vectors, bool backward, bool turn, std::size_t vector_bytes, ProgramBytes& out,
                  const Head& head, std::uint32_t planes = 1) {
  std::size_t end = out.size();
  const std::size_t step_bytes = vector_bytes * planes;
  for_each_segment(vectors, kHead, step_bytes, [&](std::uint32_t, std::uint32_t count) { end += kHead + count * step_bytes; });
  std::size_t next = backward ? end : out.size();
  out.resize(end);
  const std::size_t stride = vectors.words * sizeof(std::uint64_t), plane_stride = stride / planes;
  for_each_segment(vectors, kHead, step_bytes, [&](std::uint32_t position, std::uint32_t count) {
    const std::size_t bytes = kHead + count * step_bytes;
    if (backward) next -= bytes;
    std::byte* to = out.data() + next;
    head(to, position, count);
    to += kHead;
    const auto* from = reinterpret_cast<const std::byte*>(vectors.bits.data()) + position * stride;
    if (stride == vector_bytes && !turn) {
      std::memcpy(to, from, count * stride);
    } else {
      for (std::uint32_t p = 0; p < planes; ++p, from += plane_stride) {
        for (std::uint32_t k = 0; k < count; ++k, to += vector_bytes) {
          std::memcpy(to, from + (turn ? count - 1 - k : k) * stride, vector_bytes);
        }
      }
    }
    if (!backward) next += bytes;
  });
}

/// The position of nozzle 0 across the scan, of the carriage in nm.
inline std::int64_t across_nm(const Machine& machine, const HeadGrid& grid, std::int64_t line) {
  const double offset = machine.mounting.offset_mm[grid.scan_axis == ScanAxis::kX ? 1 : 0] * kNmPerMm;
  const double nm = grid.line_position_nm(line) + offset;
  return static_cast<std::int64_t>(nm + (nm < 0 ? -0.5 : 0.5));
}

}  // namespace lamina::program
