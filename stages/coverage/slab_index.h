// stages/coverage/slab_index.h: clusters of a mesh by height.
//
// A cluster goes to the level whose buckets are as high as the cluster or up to twice that, and there to the bucket that
// holds its lower end, so a layer meets only clusters of the buckets that it touches and of the one below, on each level.
// Memory does not depend on the number of layers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::cover {

class SlabIndex {
 public:
  /// bounds  nm, of each cluster. cost: count, scan, fill
  explicit SlabIndex(std::span<const Box> bounds);

  /// Calls `see` with every cluster that reaches above `bottom` and below `top`, nm in the frame of the mesh; each once.
  template <class See>
  void each(std::int64_t bottom, std::int64_t top, See&& see) const {
    for (const Level& level : levels_) {
      const std::int64_t buckets = static_cast<std::int64_t>(level.offset.size()) - 1;
      const std::int64_t begin = std::clamp<std::int64_t>((bottom >> level.shift) - level.first_bucket - 1, 0, buckets);
      const std::int64_t end = std::clamp<std::int64_t>((top >> level.shift) - level.first_bucket + 1, 0, buckets);
      for (std::uint32_t i = level.offset[begin]; i < level.offset[std::max(begin, end)]; ++i) {
        const Entry& entry = level.entry[i];
        if (entry.lo < top && entry.hi > bottom) see(entry.cluster);
      }
    }
  }
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

}  // namespace lamina::cover
