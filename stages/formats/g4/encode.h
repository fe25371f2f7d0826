// stages/formats/g4/encode.h: CCITT Group 4 (ITU-T T.6) straight from runs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/runs.h"
#include "stages/geometry/bits.h"

namespace lamina::formats::g4 {

struct StepsBody;
class BitWriter;

/// Encodes images one after another and keeps its scratch rows between them.
class Encoder {
 public:
  /// isa  the widest instructions to use, if the processor has them (geometry/isa.h); the bytes are the same with any
  explicit Encoder(Isa isa = Isa::kAuto);

  /// The image as T.6 code words with runs as black, then EOFB and zeros up to a whole byte, into file[start ...).
  /// Bytes before `start` are kept; the file grows as needed and may be left larger than its content.
  /// needs    1 <= columns <= 2^31 - 1 and well-formed runs (data/runs.h)
  /// returns  one past the last byte of content
  /// cost     one read of each change: below a nanosecond where rows follow each other's edges, a few where they do
  ///          not; a row like the one above costs a comparison, a stretch of empty rows the logarithm of its length
  std::size_t encode(const RunsView& runs, Buffer<std::byte>& file, std::size_t start);
  /// The same of rows, of which some at a time become runs.
  std::size_t encode(const BitRows& rows, Buffer<std::byte>& file, std::size_t start);

 private:
  BitWriter put_rows(BitWriter writer, const RunsView& runs, std::uint32_t first, Buffer<std::byte>& file);

  const StepsBody* body_;
  Buffer<std::uint32_t> coding_, reference_;  // 0, the changes of a row, then `columns` some times
};

/// The row after `row` and all empty rows that follow it. Offsets (data/runs.h) never fall, so a search by doubling finds
/// the end. cost: the logarithm of the stretch
inline std::uint32_t end_of_empty_rows(std::span<const std::uint32_t> row_offset, std::uint32_t row) {
  const std::uint32_t offset = row_offset[row];
  const std::size_t last = row_offset.size() - 1;
  std::size_t known = row + 1, step = 1;
  while (known + step <= last && row_offset[known + step] == offset) {
    known += step;
    step *= 2;
  }
  const auto limit = row_offset.begin() + static_cast<std::ptrdiff_t>(std::min(known + step, last + 1));
  const auto past = std::upper_bound(row_offset.begin() + static_cast<std::ptrdiff_t>(known), limit, offset);
  return static_cast<std::uint32_t>(past - row_offset.begin() - 1);
}

}  // namespace lamina::formats::g4
