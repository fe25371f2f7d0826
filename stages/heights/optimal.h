// stages/heights/optimal.h: the best of all layer tables.
#pragma once

#include "stages/heights/candidate_heights.h"
#include "stages/heights/heights.h"

namespace lamina::heights {

/// Of all stacks of the set's thicknesses in which no slope gets a step above options.cusp, except in layers of the
/// minimum thickness, the one with
///   1. the minimum distance from the flat that is missed most,
///   2. the minimum sum of the distances of all flats that are missed,
///   3. the fewest layers, or the minimum time,
///   4. the end that is nearest to the top, the lower one of two,
///   5. the minimum mean step, weighted by area.
/// A flat is missed by its distance from the nearest boundary if that is more than options.surface.flat_tolerance or
/// half the step that all thicknesses share, whichever is less: a flat that the thicknesses can meet is met. The top of
/// the parts counts as a flat, and the stack ends there; with options.flats off there are no flats, and the stack ends
/// at or above the top.
///
/// Every height that the thicknesses reach is a state; the cost of reaching it is known when all lower ones are (dynamic
/// programming, R. Bellman 1957; for layers, each state is one height). Because the layers allowed from a state are the
/// thinnest ones up to some limit, a state is expanded without reading the surface again.
///
/// cost  O(states * log thicknesses) where the thicknesses are all of a range and its flats can be hit, else
///       O(states * thicknesses)
Plan plan_optimal(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights);

}  // namespace lamina::heights
