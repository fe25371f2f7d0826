// stages/slice/bodies.h: boxes of parts that grow, and which of them meet from above.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/mesh.h"  // Box

namespace lamina::slice {

/// A box larger by `by` nm to its sides, not upwards; an empty one stays empty.
Box grown(Box box, Nm by);

/// The group of each box: boxes that touch in xy, directly or through the box around those that do, are one.
std::vector<std::uint32_t> group_from_above(std::vector<Box> boxes);

}  // namespace lamina::slice
