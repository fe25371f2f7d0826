// stages/raster/cut_clusters.h: clusters that an engine found become segments.
#pragma once

#include <cstdint>
#include <span>

#include "stages/raster/kernels/kernels.h"
#include "stages/raster/scan.h"

namespace lamina::raster {

/// Appends the segments of the clusters' facets in geometry rows [first_row, last_row) at height `plane`, nm on the bed.
/// out  needs room for as many as there are facets that the plane cuts and kClusterSize more, else it grows
void cut_clusters(const Kernels& kernels, const PixelSampling& sampling, std::span<const PlacedMesh> placed,
                  std::span<const ClusterVisit> visits, Nm plane, std::uint32_t first_row, std::uint32_t last_row,
                  Segments& out);

// --- planes that meet a facet, of meshes in clusters.

/// Sets the entry of every plane that a facet crosses; planes rise. cost  O(C log P) for C clusters of each mesh at its own
/// height, and 16 times that for those that meet a plane
void mark_crossed(std::span<const PlacedMesh> placed, std::span<const Nm> planes, std::span<std::uint8_t> crossed);

}  // namespace lamina::raster
