// stages/raster/height_buckets.h: engine `contours`: facets looked up by height.
//
// A cluster goes to the level whose buckets are as high as the cluster or up to twice that, and there to the bucket that
// holds its lower end. A plane meets only clusters of its own bucket and of the one below, on each level. Memory does
// not depend on the number of layers and no facet is listed twice, however tall it is.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/raster/scan.h"

namespace lamina::raster {

class HeightBuckets {
 public:
  /// count, scan, fill; O(clusters)
  explicit HeightBuckets(const ClusteredMesh& mesh);

  /// Appends every cluster that the plane (nm, in the frame of the mesh) may cut; each once.
  void find_clusters(std::int64_t plane, std::uint32_t instance, ClusterVisits& out) const;

  std::uint64_t bytes() const;

 private:
  struct Entry {
    Nm lo, hi;
    std::uint32_t cluster;
  };
  struct Level {
    std::uint32_t shift = 0;        // a bucket is 2^shift nm high
    std::int64_t first_bucket = 0;  // number of the lowest one
    Buffer<std::uint32_t> offset;   // buckets + 1
    Buffer<Entry> entry;
  };
  std::vector<Level> levels_;  // only those that hold something
};

}  // namespace lamina::raster
