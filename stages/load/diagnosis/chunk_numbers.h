// stages/load/diagnosis/chunk_numbers.h: which corners of a chunk of facets are the same point, found in a core's cache;
// internal to load.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stages/data/mesh.h"
#include "stages/load/repair/vertices.h"

namespace lamina::load {

/// The upper bits depend on all of the point.
inline std::uint64_t point_hash(const Point3& p) {
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
    for (std::uint32_t i = 0; i < corners; ++i)
      hash_[i] = static_cast<std::uint16_t>(point_hash(corner[i]) >> (64 - kSlotBits));
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

}  // namespace lamina::load
