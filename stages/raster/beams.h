// stages/raster/beams.h: engine `rays`: Embree finds the clusters that a band of rows can meet.
//
// One ray a band runs along the middle of its rows, in the plane of the layer, towards +x. Each run of 256 clusters
// (HeightRuns) is one user primitive whose box is grown by half a band in y, and by more than float rounding everywhere.
// So the ray passes the box of every run that any row of the band could cross: nothing is lost to rounding. The run's own
// table then gives those of its clusters that the plane can meet. A cluster that is met without need is only read in vain:
// whether, in which rows and where a triangle is crossed is decided in integers from its corners (segment.h). And a traversal
// reports a primitive once, so nothing is counted twice.
//
// Source: I. Wald, S. Woop, C. Benthin, G. S. Johnson, M. Ernst, "Embree: A Kernel Framework for Efficient CPU Ray
// Tracing", ACM Transactions on Graphics 33(4), 2014, for the tree; growing boxes in place of rays is ours.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/raster/scan.h"

namespace lamina::raster {

/// Clusters of a mesh in runs, each with a table of heights and depths to be searched.
///
/// Clusters that follow each other are neighbours in the file and ordered by height (mesh_blocks.h). So a run of them is one
/// box that a tree holds cheaply, and a plane meets few of its clusters, which a search of the run's table finds, first of 16
/// groups and then of theirs: heights and depths in steps of 1/65536 of the run, rounded down on both sides of every
/// comparison, so that none is missed. A cluster that begins or ends in the plane's own step is tested by its box, so that no
/// more are found than a layer's bound counts; one that is found without need outside of the rows is only read in vain.
class HeightRuns {
 public:
  static constexpr std::uint32_t kRun = 256;  // clusters: a block of 4096 triangles, as ordered by make_clusters()

  /// bounds  of each cluster, nm; must outlive the runs
  /// cost    O(clusters), parallel; 9 bytes a cluster
  explicit HeightRuns(std::span<const Box> bounds);

  std::uint32_t count() const { return static_cast<std::uint32_t>(runs_.size()); }
  const Box& box(std::uint32_t run) const { return runs_[run]; }

  /// Appends every cluster of the run that the plane may cut somewhere between y = low and y = high, both included; each
  /// once. Nm in the frame of the mesh.
  void find_clusters(std::uint32_t run, std::int64_t plane, std::int64_t low, std::int64_t high, std::uint32_t instance,
                     ClusterVisits& out) const;

  std::uint64_t bytes() const { return bytes_held(runs_) + bytes_held(groups_) + bytes_held(tops_); }

 private:
  static constexpr std::uint32_t kLanes = 16;
  /// 16 clusters or groups of them, side by side so that they are compared at once. A lane without a cluster begins above its
  /// end.
  struct alignas(64) Group {
    std::uint16_t z_begin[kLanes], z_last[kLanes];  // a plane cuts none but from the lowest corner to 1 nm below the highest
    std::uint16_t y_begin[kLanes], y_last[kLanes];

    void clear();
    /// Makes a lane hold what all lanes of another group do.
    void join(std::size_t lane, const Group& group);
  };
  /// Planes and rows in steps of a run.
  struct Search {
    std::uint16_t z, y_low, y_high;
    bool all_rows;  // that the run reaches
  };
  static std::uint32_t lanes_met(const Group& group, const Search& search);
  void build_run(std::span<const Box> bounds, std::uint32_t run);

  std::span<const Box> bounds_;
  Buffer<Box> runs_;
  Buffer<Group> groups_;  // kRun / kLanes a run, fewer in the last
  Buffer<Group> tops_;    // of each run: its groups
  static_assert(kRun == kLanes * kLanes);
};

class BeamIndex {
 public:
  /// Loads Embree, which build() takes a millisecond for: any thread can do so while parts are read. build() reports errors.
  static void prepare();

  /// placed     outlives the index
  /// band_rows  most rows that one ray answers for: few, and clusters are met again by the next ray; many, and the
  ///            crossings of a band no longer fit the processor's cache
  static Result<BeamIndex> build(std::span<const PlacedMesh> placed, const PixelGrid& grid, std::uint32_t band_rows);

  /// Appends every cluster that the plane may cut within geometry rows [first_row, last_row), at most band_rows of
  /// them; each once.
  void find_clusters(const PixelSampling& sampling, Nm plane, std::uint32_t first_row, std::uint32_t last_row,
                     ClusterVisits& out) const;

  /// What Embree allocated.
  std::uint64_t bytes() const;

 private:
  BeamIndex() = default;
  struct State;
  std::shared_ptr<const State> state_;
};

}  // namespace lamina::raster
