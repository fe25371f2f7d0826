// stages/formats/stl/mesh_stl.h: meshes as one binary STL file.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/support/io/file.h"

namespace lamina::formats::stl {

struct StlCounts {
  std::uint64_t triangles = 0;
  double rounding_mm = 0;  // the farthest that a coordinate moved
};

/// Meshes are lists, or blocks that keep the order of their files.
///
/// Writes all instances one after the other, in mm, facets counter-clockwise viewed from outside, with their normals.
///
/// STL holds floats: a coordinate of 256 mm moves by up to 8 nm. Equal corners stay equal, so a closed mesh stays closed;
/// what the format cannot hold is which facets are one object, and the unit.
///
/// file     open, at its beginning; the caller finishes it
/// program  stated in the header, such as "lamina 0.1.0"
/// errors   kOutput; kInput: more facets than the format's 32 bits count
/// cost     one pass; 50 bytes a triangle go to the file
Result<StlCounts> write_stl(File& file, std::span<const Mesh> meshes, std::span<const Instance> instances,
                            std::string_view program);

// --- a closed block as a binary STL file.

/// The file of a block from the origin to `size`, mm: 12 triangles, anticlockwise viewed from outside, normals left at 0.
std::string block(const std::array<double, 3>& size);

}  // namespace lamina::formats::stl
