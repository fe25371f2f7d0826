// stages/formats/stl/block.h: a closed block as a binary STL file.
#pragma once

#include <array>
#include <string>

namespace lamina::write::stl {

/// The file of a block from the origin to `size`, mm: 12 triangles, anticlockwise seen from outside, normals left at 0.
std::string block(const std::array<double, 3>& size);

}  // namespace lamina::write::stl
