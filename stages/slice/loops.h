// stages/slice/loops.h: one plane cuts the facets that it crosses, cuts are joined to chains, and gaps between chains are
// closed.
//
// A corner with z <= Z, or some nanometres above (height_for_plane()), is below the plane, as for the bitmaps; so a facet is
// cut through exactly two edges or not at all. A crossing belongs to the mesh edge that carries it and is computed from that
// edge's lower end, in the same bits for both facets that share it.
//
// Edges are found by their names, the two ends; points are never compared, so there is no tolerance and two crossings
// that round to the same nanometre stay apart. On a closed mesh every cut has a successor and every chain is a loop.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/level_face.h"
#include "stages/data/mesh.h"
#include "stages/geometry/interval_table.h"
#include "stages/slice/block_planes.h"

namespace lamina::slice {

/// A mesh edge that a plane crosses: its name is its two ends, the one below the plane first.
struct Edge {
  Point3 low, high;
  friend bool operator==(const Edge&, const Edge&) = default;
};

/// Facets of a mesh that a plane crosses.
struct CrossedFacets {
  std::span<const Triangle> list;     // of the mesh, or
  const MeshBlocks* blocks;           // where this is not null, its blocks
  std::span<const std::uint32_t> at;  // numbers in the list, or those of facet_of()
  bool closed;                        // the mesh is

  Triangle operator[](std::size_t i) const { return blocks ? facet_of(*blocks, at[i]) : list[at[i]]; }
};

/// The cuts of one layer. Cut i is walked from an edge of facet i to another one with the solid on its left. Edges are read
/// from the facets again where hashes of their names do not decide: 16 bytes a cut instead of 72.
struct Cuts {
  Buffer<std::uint32_t> order;               // in which cuts are chained; empty: as they are numbered
  Buffer<std::uint32_t> from_hash, to_hash;  // of the edges' names
  Buffer<Point2> at;                         // nm, where the edge that cut i comes from meets the plane
  LevelFace level;                           // horizontal faces among the facets

  std::size_t size() const { return at.size(); }
  std::uint32_t nth(std::uint32_t n) const { return order.empty() ? n : order[n]; }
  std::uint64_t bytes() const { return bytes_held(order) + bytes_held(from_hash) + bytes_held(to_hash) + bytes_held(at); }
};

/// Where an edge meets height z, low.z being below the plane and high.z above it. Rounded to the nearest nm, halves towards
/// +infinity on the way from the lower end; decided in integers.
Point2 crossing(const Edge& edge, std::int64_t z);

/// Cuts facets `at` of a list at height z. `cuts` is overwritten.
/// cost  one division for a facet
void cut(std::span<const Triangle> list, std::span<const std::uint32_t> at, std::int64_t z, Cuts& cuts);
/// Cuts facets of blocks, each while it is read: those that a plane crosses, which is at height z. facets  become their numbers
void cut(const BlockPlanes& planes, std::uint32_t plane, std::int64_t z, BlockScratch& scratch, Buffer<std::uint32_t>& facets,
         Cuts& cuts);

// --- which facets a plane crosses, for planes known beforehand.

/// The planes [first, last) that each facet crosses, by their numbers; facets between planes are not in it.
using PlaneIndex = IntervalTable<std::uint32_t>;

/// triangles  nm, frame of the mesh; fewer than 2^32
/// planes     nm, same frame, strictly increasing
/// cost       O(triangles + planes)
PlaneIndex index_crossings(std::span<const Triangle> triangles, std::span<const std::int64_t> planes);

// --- chains of cuts.

/// Reused from layer to layer.
struct ChainScratch {
  Buffer<std::uint32_t> slot;  // open addressing: cut + 1, or 0
  Buffer<std::uint32_t> next;  // of each cut
  Buffer<std::uint8_t> state;

  std::uint64_t bytes() const { return bytes_held(slot) + bytes_held(next) + bytes_held(state); }
};

/// Joins the cuts of `facets` at height z. Appends closed chains to `closed`, in the order of their first cut; chains that end
/// at an edge without a neighbour, of open meshes only, go to `open`, from their first to their last point. Both may hold
/// repeated and collinear points, and chains of fewer than three.
/// cost  O(C) for C cuts; the table of edges is that of one layer and stays in the cache
/// source  R. Minetto, N. Volpato, J. Stolfi et al., "An optimal algorithm for 3D triangle mesh slicing", Computer-Aided Design
/// 92 (2017), for
///         loop closure by a table; naming crossings by their edges in place of hashing points is ours
void chain(const CrossedFacets& facets, const Cuts& cuts, std::int64_t z, ChainScratch& scratch, Contours& closed,
           Contours& open);

// --- open chains of a mesh that is not closed, joined over short gaps.

struct GapReport {
  std::uint32_t closed = 0;         // gaps that were bridged
  std::int64_t largest_closed = 0;  // nm, the longest bridge, rounded up
  std::uint32_t open = 0;           // chains that stay open
  Point2 first_open{};              // start of the first of these

  void add(const GapReport& other) {
    if (open == 0) first_open = other.first_open;
    closed += other.closed;
    largest_closed = std::max(largest_closed, other.largest_closed);
    open += other.open;
  }
};

/// Joins ends of chains to starts of chains that are at most `maximum` nm away by a straight segment, shortest first
/// (then by the chains' order); every end and start once. What has become a loop goes to `closed`; what has not stays
/// in `open`, joined.
/// cost  O(K log K) for K chains as a rule
GapReport close_gaps(Contours& open, Nm maximum, Contours& closed);

// --- meshes whose copies share their cuts.

/// A mesh at a height, and the planes of the bed that its facets cross.
struct SourceMesh {
  std::uint32_t mesh;
  Nm z;
  std::shared_ptr<const PlaneIndex> list;     // of a mesh that is a list
  std::shared_ptr<const BlockPlanes> blocks;  // else

  /// A plane crosses no more facets than this.
  std::uint64_t max_found(std::uint32_t plane) const { return blocks ? blocks->count(plane) : list->max_found(plane); }
  std::uint64_t bytes() const { return blocks ? blocks->bytes() : list->bytes(); }
};

/// meshes  lists, or blocks that keep the order of their files; they stay where they are
/// The meshes at the heights at which instances stand, in the order of the instances. source_of  becomes that of each instance
std::vector<SourceMesh> find_sources(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                     std::span<const Nm> planes, std::vector<std::uint32_t>& source_of);

/// Appends contours, moved.
void append_moved(const Contours& from, Point2 by, Contours& to);

}  // namespace lamina::slice
