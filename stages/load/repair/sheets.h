// stages/load/repair/sheets.h: surfaces attached to a solid without enclosing anything; internal to load.
#pragma once

#include <cstdint>
#include <span>

#include "stages/load/repair/topology.h"

namespace lamina::load {

struct StraySheets {
  Buffer<std::uint8_t> drop;  // for each facet whether it belongs to one
  std::uint64_t sheets = 0, facets = 0;
};

/// A patch is what hangs together over edges with two facets. A stray sheet is a patch with an open rim that meets
/// other facets only along edges which are unmatched with it and balanced without it: a fin that was left on a solid.
/// Capping its rim would invent a body as wide as the fin. An open shell that merely touches another one is none: it
/// leaves the edges where they touch as balanced as they are. Where two such patches meet, neither is dropped.
/// cost  O(T) after sorting
StraySheets find_stray_sheets(std::size_t facet_count, std::span<const Side> sides);

/// Pieces that cannot enclose anything: facets that hang together over vertices, with open edges, all of whose vertices
/// lie within `tolerance_nm` or a thousandth of the piece's size of a plane. A loose facet is one. A cap would put a
/// second sheet upon them.
/// cost  O(T) after sorting
StraySheets find_flat_pieces(const Indexed& mesh, std::span<const Side> sides, std::int64_t tolerance_nm);

}  // namespace lamina::load
