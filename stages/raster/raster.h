// stages/raster/raster.h: meshes on a bed and a plane become the runs of a layer image.
//
// A pixel is set if and only if the winding number of all facets together about its centre, in the plane of the layer,
// satisfies the fill rule. That is decided exactly (segment.h), so the two engines, which only find the facets that a
// plane cuts, give the same bits: `rays` walks an Embree tree with one ray a band of rows, `contours` finds facets
// by height and needs no tree.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/raster/scan.h"

namespace lamina::raster {

enum class Engine : std::uint8_t { kRays, kContours };

/// Scratch memory of one layer in flight; any layer may follow any other in it.
struct LayerScratch {
  ClusterVisits visits;
  ClusterVisits near;  // those of a band of rows, where a layer has many
  Segments segments;
  ScanConverter scan;
  std::uint64_t bytes() const { return bytes_held(visits) + bytes_held(near) + segments.bytes() + scan.bytes(); }
};

/// Immutable once built, and copies share it; layers may be requested from any number of threads.
class Rasterizer {
 public:
  /// meshes     triangles are moved out of them, into blocks: 13 to 36 bytes a triangle (mesh_blocks.h)
  /// instances  where copies stand; every corner within the grid's bed (0 <= x <= length) and below kNmReach
  /// rays, contours  which indices to build; an engine that was not built must not be requested
  /// isa        instructions of the kernels; no effect on any layer
  /// errors     kInternal if Embree fails; kUsage if the processor has no such instructions
  /// cost       O(T); Embree's tree is one primitive a cluster of 16 triangles, copies share it
  static Result<Rasterizer> build(std::span<Mesh> meshes, std::span<const Instance> instances, const PixelGrid& grid,
                                  FillRule rule, bool rays, bool contours, Isa isa = Isa::kAuto);

  /// The runs of the layer at height `plane` (nm), into `out` (its capacity is reused).
  /// shift  of the sampling points from the centres of pixels along x and y, nm, at most half a pixel: then corners must be a
  ///        pixel away from the edges of the bed
  /// cost  O(facets near the plane + crossings log(crossings of a row)); no allocation once the scratch is warm
  LayerReport layer(Engine engine, Nm plane, LayerScratch& scratch, Runs& out, const std::array<Nm, 2>& shift = {}) const;

  /// Bytes that the layer at `plane` may need at most: scratch and runs. From tables of heights, made once (layer_bound.h).
  std::uint64_t layer_bytes_bound(Nm plane) const;
  /// Crossings that the layer at `plane` may have at most.
  std::uint64_t crossings_bound(Nm plane) const;

  /// Sets the entry of every plane that a facet crosses; planes rise. cost  O(C log P) for C clusters of each mesh at its own
  /// height, and 16 times that for those that meet a plane
  void mark_crossed(std::span<const Nm> planes, std::span<std::uint8_t> crossed) const;

  std::uint64_t index_bytes() const;  // trees, boxes and buckets

 private:
  Rasterizer() = default;
  struct State;
  std::shared_ptr<const State> state_;
};

}  // namespace lamina::raster
