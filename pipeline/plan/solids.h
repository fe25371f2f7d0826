// pipeline/plan/solids.h: the parts of a scene as solids of one material each.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/machine/materials.h"
#include "pipeline/plan/scene.h"
#include "stages/data/grid.h"
#include "stages/data/status.h"
#include "stages/raster/raster.h"

namespace lamina::pipeline {

/// Instances that are filled together by the fill rule.
struct Solid {
  PartMaterial material;
  raster::Rasterizer rasterizer;
  std::vector<std::uint32_t> instance;  // of the scene, for each of its own; empty: all of them
};

/// All solids of a scene. A scene of one material is one solid. Else parts that are of one material at all heights are one
/// solid, unless a part lies in front of an earlier one of another material: later solids in the list are laid over
/// earlier ones, so that where parts of different materials overlap, the later part of the job counts.
class Solids {
 public:
  /// Moves the triangles out of the scene's meshes.
  /// errors  of Rasterizer::build
  static Result<Solids> build(Scene& scene, const Job& job, const PixelGrid& grid, const Materials& materials);

  std::span<const Solid> all() const { return solids_; }

  // Of all of them together, at a height.
  std::uint64_t layer_bytes_bound(Nm plane) const;
  std::uint64_t crossings_bound(Nm plane) const;
  std::uint64_t mesh_bytes() const;
  std::uint64_t index_bytes() const;

 private:
  std::vector<Solid> solids_;
};

}  // namespace lamina::pipeline
