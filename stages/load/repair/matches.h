// stages/load/repair/matches.h: which open edges could be one edge; internal to load.
#pragma once

#include <cstdint>
#include <span>

#include "stages/load/repair/topology.h"

namespace lamina::load {

/// A facet's side that no other facet shares.
struct OpenSide {
  std::uint32_t from, to, apex;  // vertices; the apex is the facet's third
};

enum class MatchKind : std::uint8_t {
  kOpposite,  // one runs from `to` to `from` of the other
  kAlong,     // `to` of the first is at `from` of the second, which runs back along it
  kEqual      // both run the same way: one of the facets is turned over
};

struct Match {
  double cost;  // square of the larger distance between ends, nm2
  MatchKind kind;
  std::uint32_t first, second;  // indices of open sides; first < second unless kAlong
};

/// Open sides in the order of `sides`.
Buffer<OpenSide> open_sides(const Indexed& mesh, std::span<const Side> sides);

/// All pairs within the distance whose ends are no further apart than half of the shortest edge there, and whose facets
/// do not lie upon each other. Sorted: kind, cost, sides.
/// shortest  for each vertex the length of the shortest edge at it, nm
/// cost      O(E log E) for E open sides, parallel; the same for any number of threads
Buffer<Match> find_matches(const Indexed& mesh, std::span<const OpenSide> open, std::span<const float> shortest,
                           std::int64_t distance_nm);

}  // namespace lamina::load
