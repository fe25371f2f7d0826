// stages/load/diagnosis/chunk_edges.h: the edges between the facets of a chunk, found in a core's cache, and those between
// chunks; internal to load.
#pragma once

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"
#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/vertices.h"

namespace lamina::load {

/// Inspects one chunk of a numbered list (vertices.h) after the other, in memory of its own: 260 KiB, which stays in a core's
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

/// Sides by their lower vertex: a list a vertex, each in the order of edges and then of facets.
class SideLists {
 public:
  /// sides  their memory goes as they are taken
  /// cost   O(V + S) and sorting each list; 16 bytes a side and 4 a vertex
  SideLists(std::uint32_t vertices, std::span<Buffer<Side>> sides);

  std::span<const Side> of(std::uint32_t vertex) const {
    return {sides_.data() + begin_[vertex], begin_[vertex + 1] - begin_[vertex]};
  }

 private:
  Buffer<std::uint32_t> begin_;  // of each vertex, and the end
  Buffer<Side> sides_;
};

// --- facets that a mesh has twice.

/// Of some facets, those that an earlier one of them in the list has the same corners as, in the same orientation; each once,
/// in no order. A facet that uses a vertex twice has no orientation. facets: is overwritten
std::vector<std::uint32_t> repeats_among(const Numbered& mesh, std::vector<std::uint32_t>& facets);

// --- counts what is wrong, and keeps the first places of it.

inline Point3 middle(const Point3& p, const Point3& q) {
  const auto half = [](Nm one, Nm other) { return static_cast<Nm>((std::int64_t{one} + other) / 2); };
  return {half(p.x, q.x), half(p.y, q.y), half(p.z, q.z)};
}

/// Counts, and keeps the `places` with the smallest triangles, of one triangle the lowest edges.
class Collector {
 public:
  explicit Collector(std::size_t positions) : positions_(positions) {}

  /// At an edge between two points, or at a point.
  void add(std::uint32_t triangle, const Point3& p, const Point3& q) {
    ++count_;
    keep({triangle, std::min(p, q), std::max(p, q)});
  }
  void add(const Collector& other) {
    count_ += other.count_;
    for (const Found& found : other.first_) keep(found);
  }
  std::uint64_t count() const { return count_; }
  Diagnosis::Finding finding() const {
    Diagnosis::Finding result{count_, {}};
    for (const Found& found : first_) result.first.push_back({found.triangle, middle(found.low, found.high)});
    return result;
  }

 private:
  struct Found {
    std::uint32_t triangle;
    Point3 low, high;
    friend auto operator<=>(const Found&, const Found&) = default;
  };
  void keep(const Found& found) {
    if (first_.size() == positions_ && (positions_ == 0 || first_.back() <= found)) return;
    if (first_.size() == positions_) first_.pop_back();
    first_.insert(std::upper_bound(first_.begin(), first_.end(), found), found);
  }

  std::size_t positions_;
  std::uint64_t count_ = 0;
  std::vector<Found> first_;
};

/// Degenerate facets of a list that any number of threads show piece by piece.
class DegenerateFacets {
 public:
  explicit DegenerateFacets(std::size_t positions) : positions_(positions), found_(positions) {}

  /// first  the number of the first of these facets
  void inspect(std::uint32_t first, std::span<const Triangle> facets) {
    Collector here(positions_);
    for (std::size_t i = 0; i < facets.size(); ++i)
      if (!has_area(facets[i])) here.add(first + static_cast<std::uint32_t>(i), facets[i].a, facets[i].a);
    if (here.count() == 0) return;
    const std::lock_guard lock(mutex_);
    found_.add(here);
  }
  Diagnosis::Finding finding() const { return found_.finding(); }

 private:
  std::size_t positions_;
  Collector found_;
  std::mutex mutex_;
};

}  // namespace lamina::load
