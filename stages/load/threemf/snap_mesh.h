// stages/load/threemf/snap_mesh.h: a mesh of indices becomes facets in nanometres; internal to load.
#pragma once

#include <array>

#include "stages/load/reader.h"
#include "stages/load/threemf/model.h"

namespace lamina::load {

struct SnappedMesh {
  Facets facets;
  std::array<double, 3> margin{0.5, 0.5, 0.5};  // nm, by axis: how far the nearest coordinate is from being rounded otherwise
};

/// Snaps each vertex once and puts the triangles together, turned over if the transform mirrors.
///
/// label      of the object, for errors
/// transform  from the numbers of the file to mm
/// errors     kInput: a corner that is not finite, unless options.drop_bad, or beyond reach
/// cost       parallel; 13 bytes a vertex besides the facets
Result<SnappedMesh> snap_mesh(const Source& source, const ModelObject& object, const std::string& label,
                              const Transform& transform, const LoadOptions& options);

}  // namespace lamina::load
