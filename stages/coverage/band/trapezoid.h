// stages/coverage/band/trapezoid.h: the piece of a facet between two of its corners, projected along x.
//
// Two edges of the facet's piece within the layer bound it, and a plane of one y at each end. So each row of voxels cuts a
// trapezoid out of it again, by two chords.
#pragma once

#include <cstdint>

#include "stages/coverage/edges.h"
#include "stages/coverage/slab_facet.h"
#include "stages/data/buffer.h"

namespace lamina::coverage {

/// nm, from the lowest corner of the facet's box.
struct Trapezoid {
  /// An edge: a point of it, and what a step along y adds.
  struct TrapezoidSide {
    double y, x, z, dx, dz;
  };
  TrapezoidSide on, back;             // in the order of the facet's corners downwards, and against it
  double low, high;                   // y at its ends
  double left, right;                 // x that it reaches
  double slope_margin;                // by which x of a chord may be off
  double from_x, from_y;              // the lowest corner, on the bed
  double size;                        // of the facet
  std::uint32_t facet;                // its index in the layer
  std::uint32_t first_row, last_row;  // geometry rows that it may reach; last_row included
  bool edgewise, suspect;             // as SlabFacet has them
};

/// Appends the trapezoids of a facet, at most one less than it has corners, from the highest down; one without height if the
/// facet has none.
void cut_trapezoids(const SlabFacet& facet, std::uint32_t index, const Edges& rows, Buffer<Trapezoid>& to);

}  // namespace lamina::coverage
