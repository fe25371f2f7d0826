// stages/formats/g4/empty_rows.h: the end of a stretch of white rows.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

namespace lamina::formats::g4 {

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
