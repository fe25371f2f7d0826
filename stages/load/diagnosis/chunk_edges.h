// stages/load/diagnosis/chunk_edges.h: the edges between the facets of a chunk, found in a core's cache; internal to load.
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

// --- which corners of a chunk are the same vertex, found in a core's cache; internal to
// load.

/// The upper bits depend on all of the point.
inline std::uint64_t hash_of(const Point3& p) {
  const std::uint64_t xy = static_cast<std::uint32_t>(p.x) | std::uint64_t{static_cast<std::uint32_t>(p.y)} << 32;
  const std::uint64_t mixed = (xy ^ xy >> 29) * 0x9e3779b97f4a7c15u + static_cast<std::uint32_t>(p.z) * 0x2d358dccaa6c78a5u;
  return (mixed ^ mixed >> 32) * 0x8bb84b93962eacc9;
}

/// Numbers the corners of one chunk after the other, in memory that stays in a core's cache. Corners find the first corner that
/// is the same point through a table in which the first corner of each hash stands: it is written from the last corner to the
/// first, so no branch depends on what it held. Points whose slot another one has are few, and are found by probing.
class ChunkNumbers {
 public:
  /// point  where to write the points, at most as many as corners; may be where the triangles begin, or before
  /// returns  how many there are
  std::uint32_t number(std::span<const Triangle> triangles, Numbered::Local* facets, Point3* point) {
    const auto corners = static_cast<std::uint32_t>(3 * triangles.size());
    const Point3* const corner = &triangles.front().a;
    match({corner, corners});
    std::uint32_t count = 0;
    std::uint16_t* const number = facets->data();
    for (std::uint32_t i = 0; i < corners; ++i) {
      number_[i] = static_cast<std::uint16_t>(count);  // of a first corner
      number[i] = number_[first_[i]];
      const Point3 at = corner[i];  // not behind point[count], which is read no more
      point[count] = at;
      count += first_[i] == i;
    }
    return count;
  }

 private:
  static constexpr std::uint16_t kNone = UINT16_MAX;
  static constexpr int kSlotBits = 15;
  static constexpr std::size_t kSlots = std::size_t{1} << kSlotBits;

  static bool same(const Point3& p, const Point3& q) { return ((p.x ^ q.x) | (p.y ^ q.y) | (p.z ^ q.z)) == 0; }

  void match(std::span<const Point3> corner) {
    const auto corners = static_cast<std::uint32_t>(corner.size());
    for (std::uint32_t i = 0; i < corners; ++i) hash_[i] = static_cast<std::uint16_t>(hash_of(corner[i]) >> (64 - kSlotBits));
    for (std::uint32_t i = corners; i-- > 0;) slot_[hash_[i]] = static_cast<std::uint16_t>(i);
    std::uint32_t unmatched = 0;
    for (std::uint32_t i = 0; i < corners; ++i) {
      first_[i] = slot_[hash_[i]];
      rest_[unmatched] = static_cast<std::uint16_t>(i);
      unmatched += !same(corner[i], corner[first_[i]]);
    }
    if (unmatched == 0) return;
    slot_.fill(kNone);
    for (std::uint32_t r = 0; r < unmatched; ++r) {
      const std::uint16_t i = rest_[r];
      std::size_t at = hash_[i];
      while (slot_[at] != kNone && !same(corner[i], corner[slot_[at]])) at = (at + 1) % kSlots;
      if (slot_[at] == kNone) slot_[at] = i;
      first_[i] = slot_[at];
    }
  }

  std::array<std::uint16_t, kSlots> slot_;
  std::array<std::uint16_t, 3 * Numbered::kChunk> hash_, first_, number_, rest_;
};

// --- counts what is wrong, and keeps the first places of it; internal to load.

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
