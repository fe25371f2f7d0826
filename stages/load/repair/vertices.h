// stages/load/repair/vertices.h: which corners are the same vertex, by hashing; internal to load.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"
#include "stages/load/repair/topology.h"

namespace lamina::load {

/// A mesh with shared vertices, which count from 0 in the order in which facets first name them, so that what is close in a
/// file stays close. Move-only.
class Numbered {
 public:
  /// The numbers are the same on every machine. Where they need not rise as points do, this takes a third of the time and a
  /// quarter of the memory of index_mesh().
  /// cost  O(T), one thread; 12 bytes a triangle and 12 a vertex, and meanwhile up to 16 more a vertex
  explicit Numbered(std::span<const Triangle> triangles);
  /// The same in the memory of the list: numbers take the place of corners, and what is left over goes back to the system as
  /// the list is read.
  explicit Numbered(Buffer<Triangle>&& triangles);
  Numbered(const Numbered&) = delete;
  Numbered& operator=(const Numbered&) = delete;

  std::span<const Indexed::Facet> facets() const { return facets_; }  // in the order of the triangles
  std::span<const Point3> vertices() const { return vertices_; }

  Triangle triangle(std::uint32_t facet) const {
    const auto& [a, b, c] = facets_[facet];
    return {vertices_[a], vertices_[b], vertices_[c]};
  }

  /// The list whose memory was taken, as it was; nothing else may be asked for afterwards.
  Buffer<Triangle> give_back_list();

 private:
  Buffer<Indexed::Facet> own_;
  Buffer<Triangle> taken_;
  std::span<const Indexed::Facet> facets_;  // in one of the two
  Buffer<Point3> vertices_;
};

}  // namespace lamina::load
