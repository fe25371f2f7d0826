// stages/raster/beads.h: beads of true width become runs of pixels.
//
// A pixel is set if and only if its centre lies in a bead: no farther than half of the width from the bead's straight
// line (round ends), or from the part of it between the two ends (square ends). Whole numbers decide; floating point
// only finds the neighbourhood in which they are asked.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/contours.h"  // Point2
#include "stages/data/grid.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/runs.h"
#include "stages/data/toolpaths.h"

namespace lamina::raster {

/// Collects the beads of a layer, in any order. Keeps 12 bytes for each row that a bead covers; reused from layer to
/// layer.
class BeadRaster {
 public:
  explicit BeadRaster(const PixelGrid& grid) : grid_(grid) {}

  void clear() { spans_.clear(); }
  /// a, b   nm on the bed; equal for a dot (round ends only, square ends leave nothing)
  /// width  nm, > 0 and below 2^27 (134 mm)
  /// cost   O(rows covered)
  void add(Point2 a, Point2 b, Nm width, BeadEnds ends);
  /// All beads of a layer, with round ends. origin  nm on the bed: the front left corner of the grid
  void add(std::span<const LaidBead> beads, Point2 origin);
  /// The union of all beads, as image rows (row 0 at the back). cost  O(S log(S of a row) + rows)
  void runs(Runs& out);

  std::uint64_t bytes() const { return bytes_held(spans_) + bytes_held(ordered_) + bytes_held(start_); }

 private:
  struct Span {
    std::uint32_t row, begin, end;
  };
  PixelGrid grid_;
  Buffer<Span> spans_, ordered_;
  Buffer<std::uint32_t> start_;
};

/// A grid to look at the beads in a box: pixels of 50 um, larger ones where there were more than 20 000 along a side.
PixelGrid bead_grid(const Box& box);

}  // namespace lamina::raster
