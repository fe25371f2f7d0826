// stages/load/repair/surfaces.h: whether a mesh may hold a surface that is inside out; internal to load.
#pragma once

#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina::load {

/// Whether any surface has a negative volume: a hollow, or a body that is inside out. A surface is what vertices join. Bodies that have
/// a vertex in common are one, and are searched for as follows.
///
/// In meshes of more than 131,072 triangles, and where neighbours are so far apart in the file that blocks do not name their vertices,
/// vertical lines are searched for a point whose
/// winding number is negative, a line for 128 triangles: hollows have none, and of a body that is inside out the part that lies
/// in no other body is found if it is wider than the lines are apart.
///
/// blocks   of a closed mesh of positive volume
/// cost     one surface: a parallel pass over vertices, some nanoseconds a triangle; several: three passes. 16 bytes for a sixteenth of
///          the vertices. Lines: a pass over clusters, and some 20 ns a crossing
bool may_have_negative_surface(const MeshBlocks& blocks);

}  // namespace lamina::load
