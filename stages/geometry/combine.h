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
