// stages/slice/cut.h: where one plane meets the facets that it crosses.
//
// A corner with z <= Z is below the plane, as for the bitmaps; so a facet is cut through exactly two edges or not at
// all. A crossing belongs to the mesh edge that carries it and is computed from that edge's lower end, in the same bits
// for both facets that share it.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/mesh.h"
#include "stages/geometry/interval_table.h"

namespace lamina::slice {

/// A mesh edge that a plane crosses: its name is its two ends, the one below the plane first.
struct Edge {
  Point3 low, high;
  friend bool operator==(const Edge&, const Edge&) = default;
};

/// The cuts of one layer, in the order of the facets. Cut i is walked from edge from[i] to edge to[i] with the solid on
/// its left.
struct Cuts {
  Buffer<Edge> from, to;
  Buffer<std::uint64_t> from_hash, to_hash;  // of the edges' names
  Buffer<Point2> at;                         // nm, where from[i] meets the plane

  std::size_t size() const { return at.size(); }
  std::uint64_t bytes() const {
    return bytes_held(from) + bytes_held(to) + bytes_held(from_hash) + bytes_held(to_hash) + bytes_held(at);
  }
};

/// Where an edge meets height z: low.z <= z < high.z. Rounded to the nearest nm, halves towards +infinity on the way
/// from the lower end; decided in integers.
Point2 crossing(const Edge& edge, std::int64_t z);

/// Cuts `facets` of `triangles`, all of which the plane crosses. `cuts` is overwritten.
/// cost  one division for a facet
void cut(std::span<const Triangle> triangles, std::span<const std::uint32_t> facets, std::int64_t z, Cuts& cuts);

// --- which facets a plane crosses, for planes known beforehand.

/// The planes [first, last) that each facet crosses, by their numbers; facets between planes are not in it. A corner at a plane
/// is below it.
using PlaneIndex = IntervalTable<std::uint32_t>;

/// triangles  nm, frame of the mesh; fewer than 2^32
/// planes     nm, same frame, strictly increasing
/// cost       O(triangles + planes)
PlaneIndex index_crossings(std::span<const Triangle> triangles, std::span<const std::int64_t> planes);

}  // namespace lamina::slice
