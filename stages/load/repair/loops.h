// stages/load/repair/loops.h: unmatched edges as closed loops; internal to load.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "stages/load/repair/topology.h"

namespace lamina::load {

/// Takes the edges that facets walk more often one way than the other, turned around, apart into loops that visit no
/// vertex twice, and calls cap(loop) for each: vertices in order, the smallest first, at least three. Walks begin at
/// the smallest vertex and go to the smallest next one; a loop is cut off as soon as a vertex comes again, so that
/// openings that touch in a vertex stay apart.
///
/// Every edge finds its loop: a facet enters and leaves each of its vertices equally often, hence so do the surplus
/// edges, and a walk that entered a vertex can leave it.
void for_each_loop(std::span<const Side> sides, const std::function<void(std::span<const std::uint32_t>)>& cap);

}  // namespace lamina::load
