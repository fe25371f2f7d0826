// stages/coverage/meet/meetings.h: which facets of a mesh meet others, so that voxels that hold them have to be sampled.
#pragma once

#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/mesh.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/interval_table.h"

namespace lamina::coverage {

inline Box box_of(const Triangle& t) {
  Box box;
  box.add(t.a), box.add(t.b), box.add(t.c);
  return box;
}

/// Whether they have a point in common.
inline bool boxes_meet(const Box& a, const Box& b) {
  return a.lo.x <= b.hi.x && b.lo.x <= a.hi.x && a.lo.y <= b.hi.y && b.lo.y <= a.hi.y && a.lo.z <= b.hi.z && b.lo.z <= a.hi.z;
}

/// A bit a facet: lane i of cluster c is suspect if bit i of suspects[c] is set.
using Suspects = Buffer<std::uint16_t>;

/// A facet is not suspect if it meets no other beyond what they share, if each of its edges is walked once the other way by one
/// other facet, and if the winding number in front of it is 0. The last is found by one exact ray for all facets that such
/// edges connect. So where only facets lie that are not suspect, winding numbers are 0 and 1. Facets without area are no
/// facets; who has an edge with one is suspect.
///
/// isa   the widest instructions to use; suspects are the same with any
/// cost  O(T log T) and some ten pairs a facet; parallel; 34 bytes a facet meanwhile. A group of 16 facets whose box touches
///       more than 4096 others is suspect as a whole, and so is what lies apart once 65,536 rays are shot
Suspects find_suspects(const MeshBlocks& mesh, const IntervalTable<Nm>& index, Isa isa = Isa::kAuto);

}  // namespace lamina::coverage
