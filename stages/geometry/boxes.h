// stages/geometry/boxes.h: which of many boxes touch or overlap.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "stages/data/mesh.h"  // Box

namespace lamina {

/// Whether two boxes share a point; an empty one touches nothing.
bool touch(const Box& a, const Box& b);

/// Boxes that touch, directly or through others, are one group. Groups are numbered by their first box.
/// compared  becomes the number of pairs of boxes and of boxes around boxes that were compared
/// cost      O(N log N) as a rule, for boxes at one position too: what is one group already is not compared
std::vector<std::uint32_t> group_touching(std::span<const Box> boxes, std::uint64_t* compared = nullptr);

/// Calls visit(i, j) for pairs of boxes that overlap, not merely touch, until it returns false. Empty ones overlap nothing.
///
/// returns  false: the boxes lie so that too many pairs would have to be compared, and not all were
/// cost     O(N log N + P) for P pairs that overlap in x, at most 2^26
bool for_each_overlap(std::span<const Box> boxes, const std::function<bool(std::uint32_t, std::uint32_t)>& visit);

}  // namespace lamina
