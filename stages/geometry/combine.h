// stages/geometry/combine.h: two images of the same bed, as runs or levels: what becomes of both, and where they differ.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stages/data/levels.h"
#include "stages/data/runs.h"

namespace lamina {

/// Set in one of them or both; in both; in the first but not in the second.
enum class SetOperation : std::uint8_t { kUnion, kIntersection, kDifference };

/// Whether each run of a row shares columns with that run of another row alone that has its number.
/// reach  1: runs that touch at corners touch too
inline bool rows_aligned(std::span<const std::uint32_t> a, std::span<const std::uint32_t> b, std::uint32_t reach = 0) {
  if (a.size() != b.size()) return false;
  const std::uint32_t *const one = a.data(), *const other = b.data();
  const std::size_t size = a.size();
  std::uint32_t apart = 0;
  for (std::size_t i = 0; i + 1 < size; i += 2)
    apart |= static_cast<std::uint32_t>(one[i] >= other[i + 1]) | static_cast<std::uint32_t>(other[i] >= one[i + 1]);
  for (std::size_t i = 2; i < size; i += 2)
    apart |=
        static_cast<std::uint32_t>(one[i] < other[i - 1] + reach) | static_cast<std::uint32_t>(other[i] < one[i - 1] + reach);
  return apart == 0;
}

/// Pixels of a with those of b, row by row; both of the same size; `out` is neither. cost  O(changes + rows), no sorting
void combine(const RunsView& a, const RunsView& b, SetOperation operation, Runs& out);

/// The same, behind the rows that `out` has (its row_offset is not empty).
void append_combined(const RunsView& a, const RunsView& b, SetOperation operation, Runs& out);

/// Column and row of the first pixel, row by row, that is set in one of two images alone; both of the same size, and different.
std::array<std::uint32_t, 2> first_difference(const RunsView& a, const RunsView& b);

/// The larger level of each pixel; both of the same size; `out` is neither. cost  O(runs + rows)
void larger(const LevelsView& a, const LevelsView& b, Levels& out);

/// The sum of both levels of each pixel, at most 255; the same of both.
void add_levels(const LevelsView& a, const LevelsView& b, Levels& out);
/// How many of the images set each pixel, at most 255; at least one image, all of the same size.
Levels times_set(std::span<const Runs> images);

}  // namespace lamina
