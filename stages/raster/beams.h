// stages/raster/beams.h: engine `rays`: Embree finds the clusters that a band of rows can meet.
//
// One ray a band runs along the middle of its rows, in the plane of the layer, towards +x. Each run of 256 clusters
// (height_runs.h) is one user primitive whose box is grown by half a band in y, and by more than float rounding everywhere.
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

#include "stages/data/status.h"
#include "stages/raster/scan.h"

namespace lamina::raster {

class BeamIndex {
 public:
  /// Loads Embree, which build() takes a millisecond for: any thread can do so while parts are read. build() reports errors.
  static void prepare();

  /// placed     outlives the index
  /// band_rows  most rows that one ray answers for: few, and clusters are met again by the next ray; many, and the
  ///            crossings of a band no longer fit the processor's cache
  static Result<BeamIndex> build(std::span<const PlacedMesh> placed, const PixelGrid& grid, std::uint32_t band_rows);
  BeamIndex(BeamIndex&&) noexcept;
  BeamIndex& operator=(BeamIndex&&) noexcept;
  ~BeamIndex();

  /// Appends every cluster that the plane may cut within geometry rows [first_row, last_row), at most band_rows of
  /// them; each once.
  void find_clusters(const PixelSampling& sampling, Nm plane, std::uint32_t first_row, std::uint32_t last_row,
                     ClusterVisits& out) const;

  /// What Embree allocated.
  std::uint64_t bytes() const;

 private:
  BeamIndex() = default;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::raster
