// stages/load/repair/vertices.h: which corners are the same vertex, by hashing; internal to load.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"
#include "stages/load/repair/topology.h"

namespace lamina::load {

class Numbering;

/// A mesh with shared vertices, which count from 0 in the order in which facets first name them, so that what is close in a
/// file stays close. Move-only.
class Numbered {
 public:
  /// The numbers are the same on every machine and for any number of threads. Where they need not rise as points do, this
  /// takes a fifth of the time and a third of the memory of index_mesh(). Facets of a list in which neighbours in the mesh are
  /// no neighbours count in a spatial order.
  /// bounds  of the list
  /// cost    O(T), parallel; 6 bytes a triangle, 4 for each chunk that has a vertex and 13 a vertex, meanwhile some 20 more a
  ///         vertex; 4 bytes a triangle more where the list is not in order
  Numbered(std::span<const Triangle> triangles, const Box& bounds);
  /// The same in the memory of the list, which goes back to the system as it is read.
  Numbered(Buffer<Triangle>&& triangles, const Box& bounds);
  Numbered(const Numbered&) = delete;
  Numbered& operator=(const Numbered&) = delete;

  std::size_t size() const { return local_.size(); }  // facets
  std::span<const Point3> vertices() const { return vertices_; }
  Indexed::Facet facet(std::uint32_t f) const {
    const std::uint32_t* const number = numbers_.data() + begin_[f / kChunk];
    return {number[local_[f][0]], number[local_[f][1]], number[local_[f][2]]};
  }
  /// Its number in the list.
  std::uint32_t listed(std::uint32_t f) const { return order_.empty() ? f : order_[f]; }
  /// It uses a vertex twice.
  bool collapsed(std::uint32_t f) const {
    const auto& [a, b, c] = local_[f];
    return a == b || b == c || c == a;
  }

  /// Facets were numbered in chunks of so many, each of whose points has a number in the chunk.
  static constexpr std::size_t kChunk = 4096;
  using Local = std::array<std::uint16_t, 3>;
  std::size_t chunks() const { return begin_.size() - 1; }
  std::span<const Local> local_facets(std::size_t chunk) const {
    const std::size_t first = chunk * kChunk;
    return {local_.data() + first, std::min(kChunk, size() - first)};
  }
  /// The vertices that the points of a chunk are.
  std::span<const std::uint32_t> numbers_of(std::size_t chunk) const {
    return {numbers_.data() + begin_[chunk], begin_[chunk + 1] - begin_[chunk]};
  }
  bool in_several_chunks(std::uint32_t vertex) const { return in_several_[vertex] != 0; }

  Triangle triangle(std::uint32_t f) const {
    const Indexed::Facet corners = facet(f);
    return {vertices_[corners[0]], vertices_[corners[1]], vertices_[corners[2]]};
  }

  /// The list whose memory was taken, as it was; nothing else may be requested afterwards.
  Buffer<Triangle> give_back_list();

 private:
  friend Numbering;

  Buffer<Triangle> taken_;
  Buffer<std::uint32_t> order_;  // of facets in the list; none where they count as it does
  Buffer<Point3> vertices_;
  Buffer<Local> local_;
  Buffer<std::size_t> begin_;  // of the points of each chunk, and the end
  Buffer<std::uint32_t> numbers_;
  Buffer<std::uint8_t> in_several_;  // of each vertex
};

}  // namespace lamina::load
