// stages/load/winding/remesh.h: a closed surface in place of facets that do not close; internal to load.
#pragma once

#include "stages/data/mesh.h"

namespace lamina::load {

/// What remesh() did.
struct Remeshed {
  double cell_mm = 0;  // features below are lost
};

/// Replaces the triangles by the surface on which the winding number is a half in size, within a thirtieth of a cell where
/// facets are, found on a grid of so many cells along the longest side. Closed, whatever the facets were. mesh.bounds
/// follow, mesh.fingerprint does not.
///
/// source  marching tetrahedra: Doi, Koide (1991)
/// cost    some seconds; 100 bytes a triangle and some 50 MB. The same for any number of threads.
Remeshed remesh(Mesh& mesh, int cells = 128);

}  // namespace lamina::load
