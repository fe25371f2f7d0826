// stages/checks/crossed.h: planes that meet a facet; layers at them are not rightly empty.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/mesh.h"

namespace lamina::sanity {

/// For each of some rising planes, whether a facet crosses it. cost  O(T log P) for each instance of another mesh or height
std::vector<std::uint8_t> crossed_planes(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                         std::span<const Nm> planes);

}  // namespace lamina::sanity
