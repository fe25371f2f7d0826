// stages/raster/layer_bound.h: how many segments and crossings a layer can have at most, before it is planned.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/grid.h"
#include "stages/geometry/isa.h"
#include "stages/raster/scan.h"

namespace lamina::raster {

/// What a plane can meet at most of a mesh, by slabs of height: facets that it cuts, length of their cuts along y, and
/// clusters.
///
/// A facet is cut from its lowest corner to its highest, and the depth of the cut rises evenly from nothing up to the middle
/// corner and falls again: a tent. Its height is twice the facet's area projected along x, over its own. A tent over slabs is
/// four changes of slope, so the sums of all facets take four additions each and are read by adding twice.
///
/// Slabs are 2^k nm high, counted from height 0 of the mesh, and no more than kMaxSlabs. Sums are made by many threads, in any
/// order: slopes are rounded up so that doubles add them exactly. Copyable; 16 bytes a slab.
///
/// A plane is looked up kPlaneReach higher, where it meets what it meets, though the ends of a cut may lie up to that much lower:
/// tents are higher by what a slab's slope and the facet's longest edge make of it.
class CrossingSums {
 public:
  /// lowest, highest  between which clusters lie, nm
  /// maximum          of slabs, within kMaxSlabs
  /// isa              the widest instruction set to use; sums are the same with any
  CrossingSums(Nm lowest, Nm highest, std::size_t maximum = kMaxSlabs, Isa isa = Isa::kAuto);

  /// Counts a cluster of the mesh. cost: 16 facets side by side, some nanoseconds each
  void add(const ClusteredMesh& mesh, std::uint32_t cluster);
  /// Adds what another sum of the same heights counted.
  void merge(const CrossingSums& other);

  static constexpr std::size_t kMaxSlabs = 8192;
  struct Slab {
    double depth = 0;  // nm, of all cuts together
    std::int64_t segments = 0, clusters = 0;
  };
  /// What any plane within a slab meets at most.
  struct Table {
    std::uint32_t shift = 0;  // a slab is 2^shift nm high
    std::int64_t first = 0;   // number of the lowest
    std::vector<Slab> slab;
    const Slab* at(std::int64_t plane) const;  // nullptr: nothing is there
    /// Leaves out slabs without anything at both ends, and joins the others in pairs, of which the larger counts, until there
    /// are no more than `maximum`, which is 2 or more.
    void fit(std::size_t maximum);
  };
  Table table() const;

 private:
  static constexpr std::uint32_t kFinest = 12;  // 4 micrometres
  static constexpr std::size_t kBeyond = 3;     // changes up to three slabs above the highest facet

  const Kernels& kernels_;
  std::uint32_t shift_ = kFinest;
  std::int32_t first_ = 0;
  // How much more than in the slab below: of the slope of the depth, and of counts.
  std::vector<double> bend_;
  std::vector<std::int32_t> segments_, clusters_;
};

/// Most slabs that are kept of a mesh: 6 bytes a triangle, so that thousands of small parts take little besides their meshes.
constexpr std::size_t max_slabs_of(std::uint32_t clusters) { return std::size_t{64} + 4 * std::size_t{clusters}; }

/// Counts all clusters of a mesh. cost: one parallel pass over its facets
CrossingSums sum_crossings(const ClusteredMesh& mesh, Isa isa = Isa::kAuto);

/// What is kept of each mesh. cost: as above; small meshes side by side
std::vector<CrossingSums::Table> crossing_tables(std::span<const ClusteredMesh> meshes, Isa isa = Isa::kAuto);

/// The same of everything on the bed.
class LayerBound {
 public:
  struct CrossingCount {
    std::uint64_t segments = 0, crossings = 0, clusters = 0;
  };
  /// tables  of each of `meshes`, to which `placed` refers
  LayerBound(std::span<const PlacedMesh> placed, std::span<const ClusteredMesh> meshes, std::vector<CrossingSums::Table> tables,
             const PixelGrid& grid);

  CrossingCount at(Nm plane) const;
  /// Crossings of the layer that may have the most.
  std::uint64_t max_crossings() const;
  std::uint64_t bytes() const;

 private:
  /// Copies at one height differ only in x and y.
  struct Copies {
    std::uint32_t table;
    Nm lift;
    std::uint64_t count;
  };
  CrossingCount of(const CrossingSums::Slab& slab, std::uint64_t copies) const;

  double rows_per_nm_;
  std::vector<CrossingSums::Table> tables_;  // of each mesh
  std::vector<Copies> copies_;
};

}  // namespace lamina::raster
