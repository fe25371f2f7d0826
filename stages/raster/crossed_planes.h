// stages/raster/crossed_planes.h: planes that meet a facet, of meshes in clusters.
#pragma once

#include <cstdint>
#include <span>

#include "stages/raster/scan.h"

namespace lamina::raster {

/// Sets the entry of every plane that a facet crosses; planes rise. cost  O(C log P) for C clusters of each mesh at its own
/// height, and 16 times that for those that meet a plane
void mark_crossed(std::span<const PlacedMesh> placed, std::span<const Nm> planes, std::span<std::uint8_t> crossed);

}  // namespace lamina::raster
