// stages/raster/kernels/tents.h: what a plane can meet of a facet at most, slab by slab, for the facets of a cluster.
#pragma once

#include <cstdint>

#include "stages/data/choices.h"
#include "stages/geometry/blocks/cluster.h"

namespace lamina::raster {

/// The tents of a cluster's facets (layer_bound.h): slabs of their ends and slopes. Facets that no plane cuts have neither
/// height nor count.
struct alignas(64) Tents {
  std::int32_t begin[kClusterSize], last[kClusterSize];  // slabs that the facet reaches
  std::int32_t rise[kClusterSize], fall[kClusterSize];   // slabs over which it rises and falls, at least 1
  float up[kClusterSize], down[kClusterSize];            // nm a slab
  std::int32_t count[kClusterSize];                      // 1 where a plane cuts it
};

/// Raises the tents of a cluster. Slabs are 2^shift nm high and counted from `first`.
using RaiseTents = void(const Cluster& cluster, std::uint32_t shift, std::int32_t first, Tents& tents);

/// The body for an instruction set that this processor has (geometry/isa.h), not kAuto. All give the same bits.
RaiseTents* tents_for(Isa isa);

}  // namespace lamina::raster
