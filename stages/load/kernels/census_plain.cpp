#include "stages/load/kernels/kernels.h"

namespace lamina::load {

void plain::census(SortedBlock& block, std::uint64_t share, CensusSums& sums) {
  const std::uint64_t below = UINT64_MAX / share;
  std::uint16_t* hashes = block.hash.data();
  for (std::uint32_t c = 0; c < block.clusters(); ++c, hashes += SortedBlock::kCorners) {
    const auto& [z, y, x] = block.cluster[c];
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      std::uint64_t corner[3];
      for (std::uint32_t k = 0; k < 3; ++k) {
        corner[k] = hash({x[k][i], y[k][i], z[k][i]});
        hashes[k * kClusterSize + i] = static_cast<std::uint16_t>(corner[k] >> 48);
      }
      if (c * kClusterSize + i < block.triangles) add_facet(corner[0], corner[1], corner[2], below, sums);
    }
  }
}

}  // namespace lamina::load
