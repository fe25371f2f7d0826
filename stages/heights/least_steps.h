// stages/heights/least_steps.h: of all stacks with the fewest layers, the one with the least steps.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"

namespace lamina::heights {

/// Stacks on evenly spaced rungs. From rung r a layer may end on any rung from r + least to limit[r].
struct Stacks {
  std::span<const std::int32_t> layers;  // the fewest of any stack that ends on each rung; above that of `end`: none does
  std::span<const std::uint32_t> limit;  // by rung; r or less where no layer starts, else it only grows
  std::span<const double> below;         // mm2 of slopes below each rung; only grows
  std::uint32_t least;                   // rungs
  std::uint32_t end;                     // the rung on which the stack ends
};

/// For each rung on which some stack of the fewest layers to the end has a boundary, the next boundary of the one whose
/// thickness times slopes, summed over its layers, is the least from there on; other entries are UINT32_MAX.
///
/// Thickness times slopes is a product of two measures of the same interval, so that wide layer plus narrow layer within
/// it cost at least as much as the two that cross. Hence the best next boundary only moves up with the rung (F. F. Yao,
/// "Efficient dynamic programming using quadrangle inequalities", 1980), and halving finds all of them.
///
/// cost  O(rungs * log(rungs of the same number of layers))
Buffer<std::uint32_t> least_steps(const Stacks& stacks);

}  // namespace lamina::heights
