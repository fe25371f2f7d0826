// stages/coverage/coverage.h: meshes on a bed and a layer become the share of each voxel that they fill, as whole levels.
//
// The second contract. The voxel of column i and geometry row j has x in [e(i), e(i + 1)], y likewise and z in [bottom, bottom
// + thickness], where e(i) = floor(i span / dots) nm (Column edges of data/grid.h's axes): voxels tile the bed. Its share is
// the volume of the solid in it over its own. Of L levels, 0 to n = L - 1, it has floor(share n + 1/2), decided exactly: a tie
// goes up. Rows are those of every image, row 0 at the back.
//
// Where the winding number is 0 or 1, the volume is that of the exact solid. Whether it is, and the share where it is not, are
// facts of 8 x 8 x 8 samples a voxel, at the middles of eighths of its sides (e + (2 k + 1) w / 16, k = 0 .. 7, exact
// rationals): if all have winding 0 or 1 the exact volume counts, else the share is that of the samples that the fill rule
// calls solid. A winding is that of data/choices.h and raster/segment.h: a crossing at or left of a sample counts, a corner at
// or below a plane lies below it.
//
// Source: signed areas that are accumulated along a row (D. Turner, FreeType's smooth rasterizer, 2001; R. Levien, font-rs,
// 2016), here with volumes; doubles with a proven bound (docs/theory/coverage.md) and rationals where the bound does not
// decide.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "stages/coverage/band/maker.h"
#include "stages/coverage/slab_facet.h"
#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/levels.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::coverage {

// --- memory of one layer in flight.

/// What of a mesh lies in a layer, in its frame; copies at one height share it.
struct SlabShape {
  std::int64_t bottom = 0;           // of the layer, in the frame of the mesh
  std::uint32_t first = 0, end = 0;  // its facets
  bool made = false;
};

/// Any layer may follow any other in it.
struct CoverageScratch {
  Buffer<SlabShape> shape;         // of each mesh
  Buffer<SlabFacet> shape_facets;  // of all shapes
  Buffer<Trapezoid> shape_pieces;
  Buffer<SlabFacet> facets;           // of copies that reach the band at work, and what is left over of those before
  Buffer<std::uint32_t> first, next;  // facets by the band of the last row they reach: the first of each band; that behind each
  Buffer<std::uint32_t> live, unused;  // facets that entered and reach further bands; positions that others may take
  BandMaker maker;
  bool counts_held = false;  // whether layers report held_voxels, which makes them slower

  std::uint64_t bytes() const {
    return bytes_held(shape) + bytes_held(shape_facets) + bytes_held(shape_pieces) + bytes_held(facets) + bytes_held(first) + bytes_held(next) + bytes_held(live) + bytes_held(unused) + maker.bytes();
  }
};

// ---

/// The report of a layer in addition to its levels.
struct CoverageReport {
  double volume_mm3 = 0;             // sum of share x voxel, before shares become levels
  std::uint32_t facets = 0;          // that reach into the layer
  std::uint64_t held_voxels = 0;     // that hold facets, if they are counted
  std::uint64_t sampled_voxels = 0;  // whose share is that of samples
  std::uint64_t inspected = 0;       // voxels whose samples were counted, for a facet in them meets another one
  std::uint64_t exact_voxels = 0;    // that rationals decided; an interval of one share counts once
  std::uint64_t scratch_bytes = 0;
};

/// What a layer has at most, before it is planned.
struct LayerBound {
  std::uint64_t facets = 0;
  std::uint64_t voxels = 0;         // that hold facets, or end an interval of full ones
  std::uint64_t runs = 0;           // of its levels
  std::uint64_t edges = 0;          // changes of the image of those of one level and more
  std::uint64_t scratch_bytes = 0;  // its levels left out
};

/// Immutable once built, and copies share it; any number of threads may request layers.
class Coverage {
 public:
  /// meshes     triangles are moved into Mesh::blocks, unless they are there: later users of the meshes share these
  /// instances  where copies stand; every corner within the grid's bed and below kNmReach
  /// levels     2 .. 256 of them; 2, 4 and 16 are what drops come in
  /// isa        the widest instructions to use; levels are the same with any
  /// errors     kInput if a mesh is open (Mesh::closed); kUsage for another number of levels
  /// cost       O(T log T): which facets meet others is found once (meet/meetings.h)
  static Result<Coverage> build(std::span<Mesh> meshes, std::span<const Instance> instances, const PixelGrid& grid,
                                FillRule rule, std::uint32_t levels, Isa isa = Isa::kAuto);

  /// The levels of the layer's voxels, into `out` (its capacity is reused).
  /// cost  O(facets near the layer + voxels that hold facets), no matter how large the bed is; the same bytes on any thread
  CoverageReport layer(const Layer& layer, CoverageScratch& scratch, Levels& out) const;

  /// What the layer has at most. cost  O(copies)
  LayerBound bound(const Layer& layer) const;
  std::uint64_t index_bytes() const;

 private:
  Coverage() = default;
  struct State;
  std::shared_ptr<const State> state_;
};

}  // namespace lamina::coverage
