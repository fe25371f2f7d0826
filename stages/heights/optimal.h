// stages/heights/optimal.h: the best of all layer tables.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/heights/candidate_heights.h"
#include "stages/heights/heights.h"

namespace lamina::heights {

/// Of all stacks of the set's thicknesses in which no slope gets a step above options.cusp, except in layers of the
/// least thickness, the one with
///   1. the least distance from the flat that is missed most,
///   2. the least sum of the distances of all flats that are missed,
///   3. the fewest layers, or the least time,
///   4. the end that is nearest to the top, the lower one of two,
///   5. the least step on average, weighted by area.
/// A flat is missed by its distance from the nearest boundary if that is more than options.surface.flat_tolerance or
/// half the step that all thicknesses share, whichever is less: a flat that the thicknesses can meet is met. The top of
/// the parts counts as a flat, and the stack ends there; with options.flats off there are no flats, and the stack ends
/// at or above the top.
///
/// Every height that the thicknesses reach is a state; the cost of reaching it is known when all lower ones are (dynamic
/// programming, R. Bellman 1957; for layers, each state is one height). Because the layers allowed from a state are the
/// thinnest ones up to some limit, a state is expanded without looking at the surface again.
///
/// cost  O(states * log thicknesses) where the thicknesses are all of a range and its flats can be hit, else
///       O(states * thicknesses)
Plan plan_optimal(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights);

// --- of all stacks with the fewest layers, the one with the least steps.

/// Stacks on evenly spaced rungs. From rung r a layer may end on any rung from r + least to limit[r].
struct Stacks {
  std::span<const std::int32_t> layers;  // the fewest of any stack that ends on each rung; above that of `end`: none does
  std::span<const std::uint32_t> limit;  // by rung; r or less where no layer starts, else it only grows
  std::span<const double> below;         // mm2 of slopes below each rung; only grows
  std::uint32_t minimum;                 // rungs
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
Buffer<std::uint32_t> fewest_steps(const Stacks& stacks);

}  // namespace lamina::heights
