// stages/geometry/combine.h: two images of the same bed become one, as runs.
#pragma once

#include <cstdint>

#include "stages/data/levels.h"
#include "stages/data/runs.h"

namespace lamina {

/// Set in one of them or both; in both; in the first but not in the second.
enum class SetOperation : std::uint8_t { kUnion, kIntersection, kDifference };

/// Pixels of a with those of b, row by row; both of the same size; `out` is neither. cost  O(changes + rows), no sorting
void combine(const RunsView& a, const RunsView& b, SetOperation operation, Runs& out);

/// The same, behind the rows that `out` has (its row_offset is not empty).
void append_combined(const RunsView& a, const RunsView& b, SetOperation operation, Runs& out);

/// The larger level of each pixel; both of the same size; `out` is neither. cost  O(runs + rows)
void larger(const LevelsView& a, const LevelsView& b, Levels& out);

/// The sum of both levels of each pixel, at most 255; the same of both.
void add_levels(const LevelsView& a, const LevelsView& b, Levels& out);

}  // namespace lamina
