// stages/load/repair/overlaps.h: which of many boxes overlap; internal to load.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "stages/data/mesh.h"

namespace lamina::load {

/// Calls visit(i, j) for pairs of boxes that overlap, not merely touch, until it returns false. Empty ones overlap nothing.
///
/// returns  false: the boxes lie so that too many pairs would have to be compared, and not all were
/// cost     O(N log N + P) for P pairs that overlap in x, at most 2^26
bool for_each_overlap(std::span<const Box> boxes, const std::function<bool(std::uint32_t, std::uint32_t)>& visit);

}  // namespace lamina::load
