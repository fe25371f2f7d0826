// pipeline/output/scene_3mf.h: the parts of a job as they stand on the bed, as 3MF.
#pragma once

#include "pipeline/plan/scene.h"
#include "stages/data/status.h"
#include "stages/formats/threemf/threemf.h"
#include "stages/support/io/file.h"

namespace lamina::pipeline {

/// Copies share the objects of their meshes, whose names are those of files. The file is not finished.
/// scene   meshes as lists of triangles
/// errors  of formats::write_mesh_3mf
Result<formats::Mesh3mfCounts> write_scene_3mf(File& file, const Scene& scene);

}  // namespace lamina::pipeline
