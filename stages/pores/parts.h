// stages/pores/parts.h: which set voxels hang together, found on runs.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/voxels.h"

namespace lamina::pores {

/// Faces of a box, as bits: the lower one of axis a is 1 << 2 a, the upper one 2 << 2 a.
using Faces = std::uint8_t;
constexpr Faces faces_of(int axis) { return static_cast<Faces>(3 << (2 * axis)); }
inline constexpr Faces kFacesX = faces_of(0), kFacesY = faces_of(1), kFacesZ = faces_of(2), kAllFaces = 63;

/// What touches one of the faces or, on a periodic axis of these, leads around it.
/// touched, wraps  as of a part
inline bool reached(Faces touched, std::uint8_t wraps, Faces outside) {
  for (int axis = 0; axis < 3; ++axis)
    if ((outside & faces_of(axis)) != 0 && (wraps >> axis & 1) != 0) return true;
  return (touched & outside) != 0;
}

/// Parts of a box: voxels hang together if they share a face, across the ends of a periodic axis too. Parts count in the order
/// of their first runs.
///
/// Runs form pieces within the box first; pieces form parts across the ends of periodic axes. Each piece lies in a cell of the
/// lattice of boxes such that the pieces of a part, put into their cells, hang together.
struct Parts {
  Buffer<std::uint32_t> piece;               // of each run
  Buffer<std::uint32_t> part;                // of each piece
  Buffer<std::array<std::int32_t, 3>> cell;  // of each piece
  Buffer<std::uint64_t> voxels;              // of each part
  Buffer<Faces> faces;                       // of each part: those it touches, of axes that are not periodic
  Buffer<std::uint8_t> wraps;                // of each part: bit a if it leads to its own copy in another box along axis a
  std::uint32_t first_run = 0;               // run k of the changes of a view is entry k - first_run

  std::size_t size() const { return voxels.size(); }
  std::uint32_t part_of(std::size_t run) const { return part[piece[run - first_run]]; }
  bool is_reached(std::size_t p, Faces outside) const { return reached(faces[p], wraps[p], outside); }
  /// It leads from one end of the box to the other: touches both faces, or goes around if the axis is periodic.
  bool through(std::size_t p, int axis) const {
    return (wraps[p] >> axis & 1) != 0 || (faces[p] & faces_of(axis)) == faces_of(axis);
  }
};

/// source  Hoshen, Kopelman, "Percolation and cluster distribution" (1976), on runs; the cells as in Newman, Ziff, "Fast Monte
///         Carlo algorithm for site or bond percolation" (2001)
/// cost    O(runs log runs), slices in parallel; 4 bytes a run, some 30 a piece
Parts parts_of(const VoxelView& set);

/// Which parts of `set` share a face with a voxel of `other`, by part. Both have one size and no voxel in common.
/// cost  O(runs)
Buffer<std::uint8_t> adjacent_parts(const VoxelView& set, const Parts& parts, const VoxelView& other);

}  // namespace lamina::pores
