// stages/coverage/held_bound.h: how many facets and runs of levels a layer can have at most, before it is planned.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/coverage/meet/meetings.h"
#include "stages/data/grid.h"
#include "stages/data/mesh.h"
#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina::coverage {

/// Sums over the facets of a mesh by slabs of height, 2^k nm high and no more than kMaxSlabs; 112 bytes a slab.
///
/// In plan view, the piece of a facet in a layer is convex: of area A, width w and depth d in voxels it touches at most A + 2 w
/// + 2 d + 4 voxels, in d + 2 rows. Twice its width is how far its border runs along x: along the facet's edges, of
/// which each slab has its share, and along the cuts with the layer's two planes, which grow evenly up to the middle corner and
/// shrink again, as areas for each nm of height do.
///
/// Of a steep facet, and of one that meets others, each voxel may be a run of levels. Along a row of a flat one coverage only
/// rises or only falls, by its area projected along x over that of the row: of levels 0 .. n it passes n times that many, and
/// the contributions of other facets begin or end with them.
class HeldBound {
 public:
  struct HeldCount {
    std::uint64_t facets = 0;  // that reach into the layer
    std::uint64_t voxels = 0;  // that hold them, and as many more as there can be rows of voxels without a gap
    std::uint64_t runs = 0;    // of levels, full ones between facets too
    std::uint64_t edges = 0;   // changes of an image of the voxels that have some level or more
  };

  /// top_level  n. cost  some ten nanoseconds a facet
  HeldBound(const MeshBlocks& mesh, const Suspects& suspects, const PixelGrid& grid, std::uint32_t top_level);
  /// Between two heights, nm in the frame of the mesh. cost  O(1)
  HeldCount at(std::int64_t bottom, std::int64_t top) const;
  std::uint64_t bytes() const { return slab_.capacity() * sizeof(Slab); }

 private:
  static constexpr std::size_t kMaxSlabs = 8192;
  static constexpr std::uint32_t kFinest = 12;  // 4 micrometres

  /// Voxels, or levels x nm of height, in 1024ths, so that sums do not depend on their order.
  struct Sums {
    std::int64_t voxels = 0, runs = 0, rows = 0;
    std::int64_t levels = 0;  // that shares of flat facets pass, times the thickness of the layer
    void add(const Sums& more, std::int64_t times) {
      voxels += times * more.voxels, runs += times * more.runs, rows += times * more.rows;
      levels += times * more.levels;
    }
  };
  struct Slab {
    Sums below;               // of areas and edges in all slabs below
    Sums cut;                 // of any plane within
    Sums floor;               // of flat facets at its lower end, which no layer from there on holds
    std::uint64_t begin = 0;  // facets whose lowest corner lies in slabs below
    std::uint64_t end = 0;    // whose highest one does, or where they end
  };
  struct Facet;
  void add(const Triangle& facet, bool suspect);
  void add_edge(const Facet& facet, const Point3& a, const Point3& b);
  void add_parts(const Facet& facet);
  void spread(std::int64_t first, std::int64_t end, const Sums& within, const Sums& cut);
  Slab& slab(std::int64_t number) { return slab_[static_cast<std::size_t>(number + 1)]; }
  std::int64_t slab_of(std::int64_t z) const { return (z >> shift_) - first_; }

  double columns_per_nm_, rows_per_nm_, top_level_;
  std::uint32_t shift_ = kFinest;
  std::int64_t first_ = 0;
  std::vector<Slab> slab_;  // one more before the lowest, and one behind the highest
};

}  // namespace lamina::coverage
