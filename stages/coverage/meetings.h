// stages/coverage/meetings.h: which facets of a mesh meet others, so that voxels that hold them have to be sampled.
#pragma once

#include <cstdint>

#include "stages/coverage/slab_index.h"
#include "stages/data/buffer.h"
#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina::cover {

/// A bit a facet: lane i of cluster c is suspect if bit i of suspects[c] is set.
using Suspects = Buffer<std::uint16_t>;

/// Where only facets lie that are not suspect, winding numbers are 0 and 1.
Suspects find_suspects(const MeshBlocks& mesh, const SlabIndex& index);

}  // namespace lamina::cover
