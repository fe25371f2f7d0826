// stages/raster/kernels/tents.h: what a plane can meet of a facet at most, slab by slab, for the facets of a cluster.
#pragma once

#include <cstdint>

#include "stages/data/choices.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/targets.h"

namespace lamina::raster {

/// A cluster projected along x.
struct alignas(64) Sides {
  Nm z[3][kClusterSize];
  Nm y[3][kClusterSize];
};

/// The tents of a cluster's facets (layer_bound.h). Facets that no plane cuts have neither slopes nor count.
struct alignas(64) Tents {
  std::int32_t begin[kClusterSize], end[kClusterSize];  // slabs that the facet reaches, the latter beyond the last
  std::int32_t top[kClusterSize], fall[kClusterSize];   // from here on it no longer rises, and it falls
  /// nm a slab. Multiples of 2^-16: doubles add them to the same sum in any order while it stays below 2^37. Each is the same
  /// number times the slabs of the other slope, so that a tent returns to exactly nothing.
  float up[kClusterSize], down[kClusterSize];
  std::int32_t count[kClusterSize];  // 1 where a plane cuts it
};

/// The loops for an instruction set.
struct TentKernels {
  /// Fetches an indexed cluster's corners.
  void (*find)(const IndexedCluster& cluster, const Point3* vertices, Sides& sides);
  /// Slabs are 2^shift nm high and counted from `first`, and at most 2^13.
  void (*raise)(const Sides& sides, std::uint32_t shift, std::int32_t first, Tents& tents);
};

/// The bodies for an instruction set that this processor has (geometry/isa.h), not kAuto. All give the same bits.
const TentKernels& tents_for(Isa isa);

#if defined(LAMINA_WIDE_KERNELS)
namespace avx512 {
LAMINA_AVX512 void load_sides(const IndexedCluster& cluster, const Point3* vertices, Sides& sides);
}  // namespace avx512
#endif

}  // namespace lamina::raster
