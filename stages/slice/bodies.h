// stages/slice/bodies.h: which parts can overlap: those whose boxes touch are sliced as one body.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/mesh.h"  // Box

namespace lamina::slice {

/// A box larger by `by` nm to its sides, not upwards; an empty one stays empty.
Box grown(Box box, Nm by);

/// Whether two boxes share a point; an empty one touches nothing.
bool touch(const Box& a, const Box& b);

/// The body of each box. Boxes that touch, directly or through others, are one body: only there can solids overlap.
/// Bodies are numbered by their first box.
/// cost  O(N log N + P) for P pairs that overlap in x
std::vector<std::uint32_t> group_bodies(std::span<const Box> boxes);

/// The same of boxes that touch seen from above, directly or through the box around those that do.
std::vector<std::uint32_t> group_from_above(std::vector<Box> boxes);

}  // namespace lamina::slice
