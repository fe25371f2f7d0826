// stages/data/runs.h: a 1-bit image as the columns where rows change colour.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"

namespace lamina {

/// Borrowed runs of one image.
///
/// row_offset  rows + 1 entries, first 0, last change.size(); row r owns change[row_offset[r] .. row_offset[r + 1])
/// change      per row an even number of strictly increasing columns: begin, end, begin, end, ... (end exclusive).
///             Runs of a row neither touch nor overlap, and end <= columns.
/// Image row 0 is the back of the bed (largest y) unless the image was mirrored.
struct RunsView {
  std::uint32_t columns = 0;
  std::span<const std::uint32_t> row_offset;
  std::span<const std::uint32_t> change;

  std::uint32_t rows() const { return row_offset.empty() ? 0 : static_cast<std::uint32_t>(row_offset.size() - 1); }
  std::span<const std::uint32_t> row(std::uint32_t r) const {
    return change.subspan(row_offset[r], row_offset[r + 1] - row_offset[r]);
  }
};

/// Owned runs; 4 bytes a row and 8 bytes a run.
struct Runs {
  std::uint32_t columns = 0;
  Buffer<std::uint32_t> row_offset;
  Buffer<std::uint32_t> change;

  RunsView view() const { return {columns, row_offset, change}; }
  operator RunsView() const { return view(); }
};

/// Set pixels, and changes of colour.
struct PixelCounts {
  std::uint64_t set = 0, changes = 0;
};

/// What is kept of an image whose rows come one by one.
enum class Keep : std::uint8_t {
  kRuns,
  kSmaller,  // runs, or bits where runs take more than half the memory of those
  kCounts,   // numbers alone
};

/// Number of set pixels.
inline std::uint64_t set_pixels(const RunsView& runs) {
  std::uint64_t set = 0;
  for (std::size_t i = 0; i + 1 < runs.change.size(); i += 2) set += runs.change[i + 1] - runs.change[i];
  return set;
}

}  // namespace lamina
