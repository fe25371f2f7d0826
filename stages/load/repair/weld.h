// stages/load/repair/weld.h: vertices at open edges that were meant to be one; internal to load.
#pragma once

#include <cstdint>
#include <span>

#include "stages/load/repair/topology.h"

namespace lamina::load {

struct Welding {
  Buffer<std::uint32_t> target;  // for each vertex the one that it becomes, mostly itself
  std::uint64_t moved = 0;       // vertices that become another one
};

/// Looks only at vertices on edges with an odd number of facets, and takes them in lexicographic order: each that is
/// not taken yet takes all the others within `weld_nm` (straight distance). So no vertex moves further than that,
/// however many lie in a row. Two vertices with an edge between them are never joined: short edges of fine meshes
/// stay, and a facet that is missing can be put back.
/// cost  O(V log V) for V vertices on open edges
Welding find_welding(const Indexed& mesh, std::span<const Side> sides, std::int64_t weld_nm);

}  // namespace lamina::load
