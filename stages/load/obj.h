// stages/load/obj.h: Wavefront OBJ; internal to load.
#pragma once

#include "stages/load/reader.h"

namespace lamina::load {

/// Vertices and polygons; see obj.cpp for what is understood.
/// cost    one pass; 12 bytes a vertex and a corner besides the triangles
Result<Facets> read_obj(const Source& source, const Snapper& snapper, const LoadOptions& options);

}  // namespace lamina::load
