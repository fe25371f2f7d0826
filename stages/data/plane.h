// stages/data/plane.h: a number for each voxel of one plane of a box.
#pragma once

#include <cstdint>

#include "stages/data/buffer.h"

namespace lamina {

/// value  row by row: columns along the first axis but the normal, rows along the second, in the order x, y, z
struct Plane {
  int normal = 2;        // axis
  std::uint32_t at = 0;  // voxel along it
  std::uint32_t columns = 0, rows = 0;
  Buffer<float> value;
};

/// The two axes of a plane, in the order x, y, z.
constexpr int column_axis(int normal) { return normal == 0 ? 1 : 0; }
constexpr int row_axis(int normal) { return normal == 2 ? 1 : 2; }

}  // namespace lamina
