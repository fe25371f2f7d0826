// stages/slice/chain.h: cuts joined end to end by the mesh edges that they share.
//
// Edges are found by their names, the two ends; points are never compared, so there is no tolerance and two crossings
// that round to the same nanometre stay apart. On a closed mesh every cut has a successor and every chain is a loop.
#pragma once

#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/slice/cut.h"

namespace lamina::slice {

/// Reused from layer to layer.
struct ChainScratch {
  Buffer<std::uint32_t> slot;  // open addressing: cut + 1, or 0
  Buffer<std::uint32_t> next;  // of each cut
  Buffer<std::uint8_t> state;

  std::uint64_t bytes() const { return bytes_held(slot) + bytes_held(next) + bytes_held(state); }
};

/// Joins the cuts at height z. Appends closed chains to `closed`, in the order of their first cut; chains that end at
/// an edge without a neighbour, of open meshes only, go to `open`, from their first to their last point. Both may hold
/// repeated and collinear points, and chains of fewer than three.
/// cost  O(C) for C cuts; the table of edges is that of one layer and stays in the cache
/// source  R. Minetto, N. Volpato, J. Stolfi et al., "An optimal algorithm for 3D triangle mesh slicing", Computer-Aided Design
/// 92 (2017), for
///         loop closure by a table; naming crossings by their edges in place of hashing points is ours
void chain(const Cuts& cuts, std::int64_t z, ChainScratch& scratch, Contours& closed, Contours& open);

}  // namespace lamina::slice
