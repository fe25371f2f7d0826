// pipeline/plan/solids.h: groups the parts of a scene into solids of one material each.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/machine/materials.h"
#include "pipeline/plan/dose.h"
#include "pipeline/plan/scene.h"
#include "stages/coverage/coverage.h"
#include "stages/data/grid.h"
#include "stages/data/status.h"
#include "stages/raster/raster.h"

namespace lamina::pipeline {

/// Instances to which the fill rule applies together.
struct Solid {
  PartMaterial material;
  std::uint32_t zone = 0;  // of DoseZones
  raster::Rasterizer rasterizer;
  std::vector<std::uint32_t> instance;         // scene index of each of its instances; empty: all in order
  std::optional<coverage::Coverage> coverage;  // if the job asks for shares of voxels
};

/// All solids of a scene. A scene of one material and one dose is one solid. Otherwise parts with the same materials at all
/// heights and the same dose form one solid, unless a part covers an earlier one of another material or dose: later solids
/// overwrite earlier ones, so the later part of the job wins where different materials overlap.
class Solids {
 public:
  /// Moves the triangles out of the scene's meshes.
  /// errors  of Rasterizer::build and Coverage::build; kUsage: shares of voxels of what has none
  static Result<Solids> build(Scene& scene, const Job& job, const PixelGrid& grid, const Materials& materials,
                              const DoseZones& zones);

  std::span<const Solid> all() const { return solids_; }

  // Sums over all solids, at a height.
  std::uint64_t layer_bytes_bound(Nm plane) const;
  std::uint64_t crossings_bound(Nm plane) const;
  std::uint64_t index_bytes() const;

  std::uint64_t mesh_bytes() const { return mesh_bytes_; }  // each mesh once

 private:
  std::vector<Solid> solids_;
  std::uint64_t mesh_bytes_ = 0;
};

}  // namespace lamina::pipeline
