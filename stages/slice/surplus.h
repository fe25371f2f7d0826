// stages/slice/surplus.h: where shells overlap or lie inside out, what is solid is not what their volumes add up to.
#pragma once

#include <span>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::slice {

/// For each plane, mm2: the area that is solid by the rule `nonzero`, less the sum of all winding numbers over the plane.
/// Exactly 0 where closed meshes neither overlap nor lie inside out; its integral over the height is what the union of meshes
/// has more than the sum of their signed volumes.
///
/// meshes     closed
/// instances  all of them stand together
/// planes     nm, strictly increasing
/// errors     kInternal of the clipping library
/// cost       that of slicing the planes, in parallel; the same for any number of threads
Result<std::vector<double>> surplus_areas(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                          std::span<const Nm> planes);

}  // namespace lamina::slice
