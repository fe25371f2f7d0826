// stages/geometry/bits.h: between runs and rows of bits, the leftmost pixel in the highest bit of the first byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/runs.h"
#include "stages/data/units.h"

namespace lamina {

/// A side of the largest bed at the finest dpi (data/units.h, data/grid.h): no writer makes, and no reader believes,
/// more columns or rows. A row of bits is then at most 268,436 bytes.
inline constexpr std::uint32_t kMaxPixelsASide =
    static_cast<std::uint32_t>(ceil_div(kNmReach * std::int64_t{25'400}, kNmPerInch));

constexpr std::size_t row_bytes(std::uint32_t columns) { return (std::size_t{columns} + 7) / 8; }

/// Sets the bits of the runs of one row; all others, those after the last column too, become 0.
/// change  as in data/runs.h; row  row_bytes(columns) bytes
/// cost    a fill of the row and a few operations a run
void expand_row(std::span<const std::uint32_t> change, std::span<std::byte> row);

/// A row of words whose lowest bit is the leftmost pixel, as in data/bit_rows.h.
void put_words(std::span<const std::uint64_t> words, std::span<std::byte> row);

/// Collects rows of bits as runs.
class RunsBuilder {
 public:
  explicit RunsBuilder(std::uint32_t columns);

  /// Set bits are pixels, or clear bits if `invert`. Bits after the last column are ignored.
  /// row    row_bytes(columns) bytes
  /// false  if the image has 2^32 changes or more, which runs cannot hold
  /// cost   one read of each 64 bits, and a few operations a change
  bool add_row(std::span<const std::byte> row, bool invert);

  Runs finish();

 private:
  Runs runs_;
  std::size_t used_ = 0;  // of runs_.change, which is kept larger
};

}  // namespace lamina
