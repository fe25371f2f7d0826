// stages/coverage/scratch.h: memory of one layer in flight.
#pragma once

#include <cstdint>

#include "stages/coverage/band/maker.h"
#include "stages/coverage/slab_facet.h"
#include "stages/data/buffer.h"

namespace lamina::cover {

/// Any layer may follow any other in it.
struct LayerScratch {
  Buffer<SlabFacet> facets;             // that reach into the layer
  Buffer<std::uint32_t> begins, order;  // facets by the band of the last row they reach: where a band's begin; indices
  BandMaker maker;

  std::uint64_t bytes() const { return bytes_held(facets) + bytes_held(begins) + bytes_held(order) + maker.bytes(); }
};

}  // namespace lamina::cover
