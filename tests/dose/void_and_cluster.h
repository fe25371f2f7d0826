// tests/dose/void_and_cluster.h: makes the ranks of the blue-noise tile, which stages/dose/blue_noise_tile.h has as data.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace lamina::dose {

/// Void and cluster: from every 32nd of the pixels, moved from the tightest cluster to the largest void until nothing gets
/// better, ranks go down from the tightest cluster and up to the largest void. Distances count on the torus. The weights
/// are integers: (2 + distance^2)^-2 where few pixels, or few gaps, lie far apart, and a Gaussian of 1.5 pixels between,
/// so that the tile is the same everywhere.
/// source  R. Ulichney, "The void-and-cluster method for dither array generation" (1993)
std::vector<std::uint16_t> void_and_cluster_ranks();

}  // namespace lamina::dose
