// stages/load/repair/vertices.cpp: an open table of numbers, beside the list of points that they stand for.
#include "stages/load/repair/vertices.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "stages/geometry/blocks/pages.h"

namespace lamina::load {
namespace {

constexpr std::uint32_t kFree = UINT32_MAX;
/// So many facets are hashed before the first of them is looked up: the table's lines are on their way meanwhile.
constexpr std::size_t kAhead = 16;
/// So many triangles are read before their memory goes back to the system.
constexpr std::size_t kTogether = std::size_t{1} << 14;

inline std::uint64_t hash_of(const Point3& p) {
  const std::uint64_t xy = static_cast<std::uint32_t>(p.x) | std::uint64_t{static_cast<std::uint32_t>(p.y)} << 32;
  const std::uint64_t mixed = (xy ^ xy >> 29) * 0x9e3779b97f4a7c15u + static_cast<std::uint32_t>(p.z) * 0x2d358dccaa6c78a5u;
  return (mixed ^ mixed >> 32) * 0x8bb84b93962eacc9;
}

/// Numbers of points by their hashes, at most two thirds full.
class Table {
 public:
  /// expected  points; more make it grow
  explicit Table(std::size_t expected) {
    points_.reserve(expected);
    std::size_t slots = 64;
    while (2 * slots < 3 * expected) slots *= 2;
    clear(slots);
  }
  std::uint32_t size() const { return static_cast<std::uint32_t>(points_.size()); }
  Buffer<Point3> take_points() { return std::move(points_); }
  void prefetch(std::uint64_t hashed) const { __builtin_prefetch(&slots_[hashed >> shift_]); }

  std::uint32_t number_of(const Point3& p, std::uint64_t hashed) {
    std::size_t at = hashed >> shift_;
    for (; slots_[at] != kFree; at = (at + 1) & mask_)
      if (points_[slots_[at]] == p) return slots_[at];
    const std::uint32_t number = size();
    slots_[at] = number;
    points_.push_back(p);
    if (3 * points_.size() > 2 * slots_.size()) grow();
    return number;
  }

 private:
  void clear(std::size_t slots) {
    slots_.resize(slots);
    std::fill(slots_.begin(), slots_.end(), kFree);
    mask_ = slots - 1;
    shift_ = 64;
    for (std::size_t i = slots; i > 1; i /= 2) --shift_;
  }
  void grow() {
    const std::size_t slots = 2 * slots_.size();
    Buffer<std::uint32_t>().swap(slots_);
    clear(slots);
    for (std::uint32_t number = 0; number < points_.size(); ++number) {
      std::size_t at = hash_of(points_[number]) >> shift_;
      while (slots_[at] != kFree) at = (at + 1) & mask_;
      slots_[at] = number;
    }
  }

  Buffer<Point3> points_;
  Buffer<std::uint32_t> slots_;
  std::size_t mask_ = 0;
  int shift_ = 64;  // the upper bits of a hash are the slot: they depend on all of the point
};

/// Calls put(i, facet) for each triangle in order, once nothing of it is read any more. returns  the vertices
template <class Put>
Buffer<Point3> number_vertices(std::span<const Triangle> triangles, const Put& put) {
  Table table(triangles.size() / 2 + triangles.size() / 16);  // a closed mesh has half as many vertices as facets
  std::array<std::uint64_t, 3 * kAhead> hashes;
  for (std::size_t first = 0; first < triangles.size(); first += kAhead) {
    const std::size_t count = std::min(kAhead, triangles.size() - first);
    for (std::size_t i = 0; i < count; ++i) {
      const Triangle& t = triangles[first + i];
      hashes[3 * i] = hash_of(t.a), hashes[3 * i + 1] = hash_of(t.b), hashes[3 * i + 2] = hash_of(t.c);
      for (std::size_t k = 0; k < 3; ++k) table.prefetch(hashes[3 * i + k]);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const Triangle& t = triangles[first + i];
      Indexed::Facet facet;
      facet[0] = table.number_of(t.a, hashes[3 * i]);
      facet[1] = table.number_of(t.b, hashes[3 * i + 1]);
      facet[2] = table.number_of(t.c, hashes[3 * i + 2]);
      put(first + i, facet);
    }
  }
  return table.take_points();
}

char* place_of(Indexed::Facet* facets, std::size_t facet) { return reinterpret_cast<char*>(facets + facet); }

}  // namespace

Numbered::Numbered(std::span<const Triangle> triangles) : own_(triangles.size()), facets_(own_) {
  vertices_ = number_vertices(triangles, [&](std::size_t i, const Indexed::Facet& facet) { own_[i] = facet; });
}

// Facet i lies where triangle i / 3 was, which has been read by then.
Numbered::Numbered(Buffer<Triangle>&& triangles) : taken_(std::move(triangles)) {
  const std::size_t count = taken_.size();
  auto* const facets = reinterpret_cast<Indexed::Facet*>(taken_.data());
  char* unused = place_of(facets, count);  // from here on; what is read of it goes back
  vertices_ = number_vertices(taken_, [&](std::size_t i, const Indexed::Facet& facet) {
    std::memcpy(place_of(facets, i), &facet, sizeof facet);
    if ((i + 1) % kTogether != 0 && i + 1 != count) return;
    char* const read = reinterpret_cast<char*>(taken_.data() + i + 1);
    if (read <= unused) return;
    forget_pages(unused, read);
    unused = read;
  });
  facets_ = {facets, count};
}

// From the end: triangle i covers facets from 3 i on, which have been read by then.
Buffer<Triangle> Numbered::give_back_list() {
  for (std::size_t i = taken_.size(); i-- > 0;) {
    const Triangle t = triangle(static_cast<std::uint32_t>(i));
    std::memcpy(static_cast<void*>(taken_.data() + i), &t, sizeof t);
  }
  facets_ = {};
  return std::move(taken_);
}

}  // namespace lamina::load
