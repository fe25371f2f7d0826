// stages/load/diagnosis/chunk_edges.h: the edges between the facets of a chunk, found in a core's cache; internal to load.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/vertices.h"

namespace lamina::load {

/// Looks at one chunk of a numbered list (vertices.h) after the other, in memory of its own: 260 KiB, which stays in a core's
/// cache.
class ChunkEdges {
 public:
  /// Two facets that share an edge, by their places in the chunk.
  using Pair = std::array<std::uint16_t, 2>;

  /// Finds edges that are walked once either way and one of whose ends no other chunk has, so that no facet elsewhere can be at
  /// them: nearly all of those that there are.
  ///
  /// odd        becomes the sides of those other edges that have such an end, by edge and then by facet
  /// rest       is given the sides of edges that facets elsewhere may share; in no order
  /// collapsed  is given the facets that use a vertex twice
  /// returns    the facets of each edge that was found; until the next call
  /// cost       O(T); no branch depends on the facets but where edges are left over
  std::span<const Pair> find(const Numbered& mesh, std::size_t chunk, Buffer<Side>& odd, Buffer<Side>& rest,
                             Buffer<std::uint32_t>& collapsed);

 private:
  void take_sides(std::span<const Numbered::Local> facets, std::uint32_t first_facet, Buffer<std::uint32_t>& collapsed);
  std::uint32_t match(std::span<const std::uint16_t> sides, std::uint32_t factor);

  static constexpr std::size_t kSides = 3 * Numbered::kChunk;
  static constexpr int kSlotBits = 15;
  std::array<std::uint32_t, kSides> key_;  // of each side: its lower and its higher end, and whether it is walked upwards
  std::array<std::uint16_t, kSides> hash_, all_, rest_;
  std::array<std::uint16_t, std::size_t{1} << kSlotBits> slot_;
  std::array<std::uint8_t, kSides> others_;  // sides of the same edge behind the first, 2 for more
  std::array<std::uint8_t, kSides> done_;    // nothing is left to say of the side
  std::array<std::uint8_t, kSides> own_;     // no other chunk has the point
  std::array<Pair, kSides> match_;           // two sides of an edge
  std::array<Pair, kSides / 2> pair_;
  std::uint32_t pairs_ = 0;
};

/// Which facets of a chunk hang together.
class ChunkPieces {
 public:
  /// parents  of the facets of the chunk in DisjointSets, none of which is in a set with another one yet: becomes their
  /// smallest
  ///          relative by the pairs
  /// first    the number of the first of them
  void join(std::span<const ChunkEdges::Pair> pairs, std::span<std::uint32_t> parents, std::uint32_t first);

 private:
  std::uint16_t find(std::uint16_t facet);

  std::array<std::uint16_t, Numbered::kChunk> parent_;
};

}  // namespace lamina::load
