// stages/slice/plane_index.h: which facets a plane crosses, for planes known beforehand.
//
// A facet that crosses planes [first, last) lies at the level whose buckets are the next power of two of planes long,
// in the bucket of its first plane. A plane meets only facets of its own bucket and of the one before, on each level;
// at the lowest level every facet that it meets is crossed. No facet is listed twice however many planes it crosses,
// facets between planes are not listed at all, and any plane can be asked for at any time, by any thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::slice {

class PlaneIndex {
 public:
  /// triangles  nm, frame of the mesh; fewer than 2^32
  /// planes     nm, same frame, strictly increasing
  /// cost       count, scan, fill: O(T + P); 12 bytes for a facet that crosses a plane, 4 for a plane and level
  PlaneIndex(std::span<const Triangle> triangles, std::span<const std::int64_t> planes);

  /// Appends the facets that plane p crosses, each once, always in the same order. A corner at the plane is below it.
  void find(std::uint32_t plane, Buffer<std::uint32_t>& facets) const;

  /// Facets that plane p may cross; find() appends no more.
  std::uint64_t most_facets(std::uint32_t plane) const;

  std::uint64_t bytes() const;

 private:
  struct Entry {
    std::uint32_t first, last, facet;  // planes [first, last)
  };
  struct Level {
    std::uint32_t shift = 0;       // a bucket is 2^shift planes long
    Buffer<std::uint32_t> offset;  // buckets + 1
    Buffer<Entry> entry;
  };
  std::vector<Level> levels_;  // only those that hold something
};

}  // namespace lamina::slice
