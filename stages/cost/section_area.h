// stages/cost/section_area.h: how much of each height of a part is solid, to share what layers cost.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/mesh.h"

namespace lamina::cost {

/// The areas of horizontal sections of instances in mm2, at the middles of `count` equal layers from their lowest to their
/// highest point. Shells that overlap count as often as they overlap; meshes that are not closed give estimates.
///
/// meshes  as lists of triangles
/// cost    O(triangles + sections that they cross)
std::vector<double> section_areas(std::span<const Mesh> meshes, std::span<const Instance> instances, std::size_t count);

}  // namespace lamina::cost
