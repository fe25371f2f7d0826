#include "pipeline/output/scene_3mf.h"

#include <fmt/format.h>

#include <filesystem>
#include <vector>

#include "stages/support/text/version.h"

namespace lamina::pipeline {

Result<formats::Mesh3mfCounts> write_scene_3mf(File& file, const Scene& scene) {
  std::vector<formats::Mesh3mfObject> objects;
  for (const Mesh& mesh : scene.meshes)
    objects.push_back({std::filesystem::path(mesh.name).filename().string(), mesh.triangles});
  return formats::write_mesh_3mf(file, objects, scene.instances, fmt::format("lamina {}", version()));
}

}  // namespace lamina::pipeline
