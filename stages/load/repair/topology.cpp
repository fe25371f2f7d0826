// stages/load/repair/topology.cpp: sorting brings together what is equal, the same way for any number of threads.
#include "stages/load/repair/topology.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <atomic>
#include <numeric>
#include <tuple>

namespace lamina::load {

Indexed index_mesh(std::span<const Triangle> triangles) {
  struct Corner {
    Point3 at;
    std::uint32_t index;
  };
  Buffer<Corner> corners(3 * triangles.size());
  tbb::parallel_for(std::size_t{0}, triangles.size(), [&](std::size_t i) {
    const auto first = static_cast<std::uint32_t>(3 * i);
    corners[3 * i] = {triangles[i].a, first};
    corners[3 * i + 1] = {triangles[i].b, first + 1};
    corners[3 * i + 2] = {triangles[i].c, first + 2};
  });
  // Equal points need no order among themselves: they all get one index.
  tbb::parallel_sort(corners.begin(), corners.end(), [](const Corner& one, const Corner& other) {
    return std::tie(one.at.x, one.at.y, one.at.z) < std::tie(other.at.x, other.at.y, other.at.z);
  });
  Indexed mesh;
  mesh.facet.resize(triangles.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (i == 0 || corners[i].at != corners[i - 1].at) mesh.vertex.push_back(corners[i].at);
    mesh.facet[corners[i].index / 3][corners[i].index % 3] = static_cast<std::uint32_t>(mesh.vertex.size() - 1);
  }
  return mesh;
}

Buffer<Side> sorted_sides(std::span<const Indexed::Facet> facets) {
  Buffer<Side> sides;
  sides.reserve(3 * facets.size());
  for (std::uint32_t f = 0; f < facets.size(); ++f) {
    if (collapsed(facets[f])) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = facets[f][k], to = facets[f][(k + 1) % 3];
      sides.push_back({std::min(from, to), std::max(from, to), f, from < to});
    }
  }
  tbb::parallel_sort(sides.begin(), sides.end(), [](const Side& one, const Side& other) {
    return std::tie(one.low, one.high, one.facet) < std::tie(other.low, other.high, other.facet);
  });
  return sides;
}

Buffer<std::uint8_t> repeats(std::span<const Indexed::Facet> facets) {
  struct Key {
    Indexed::Facet corner;
    std::uint32_t facet;
  };
  Buffer<Key> keys(facets.size());
  tbb::parallel_for(std::size_t{0}, facets.size(), [&](std::size_t i) {
    Indexed::Facet corner = facets[i];
    std::rotate(corner.begin(), std::min_element(corner.begin(), corner.end()), corner.end());
    keys[i] = {corner, static_cast<std::uint32_t>(i)};
  });
  tbb::parallel_sort(keys.begin(), keys.end(), [](const Key& one, const Key& other) {
    return std::tie(one.corner, one.facet) < std::tie(other.corner, other.facet);
  });
  Buffer<std::uint8_t> repeated(facets.size(), std::uint8_t{0});
  for (std::size_t i = 1; i < keys.size(); ++i)
    if (keys[i].corner == keys[i - 1].corner) repeated[keys[i].facet] = 1;
  return repeated;
}

DisjointSets::DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }

// A member that is no representative never becomes one again, and all that is written over its parent is another ancestor.
std::uint32_t DisjointSets::find(std::uint32_t member) {
  const auto parent_of = [&](std::uint32_t of) {
    return std::atomic_ref<std::uint32_t>(parent_[of]).load(std::memory_order_relaxed);
  };
  for (std::uint32_t parent = parent_of(member); parent != member;) {
    const std::uint32_t above = parent_of(parent);
    if (above == parent) return parent;
    std::atomic_ref<std::uint32_t>(parent_[member]).store(above, std::memory_order_relaxed);
    member = above, parent = parent_of(member);
  }
  return member;
}

void DisjointSets::join(std::uint32_t one, std::uint32_t other) {
  while ((one = find(one)) != (other = find(other))) {
    std::uint32_t larger = std::max(one, other);
    const std::atomic_ref<std::uint32_t> parent(parent_[larger]);
    if (parent.compare_exchange_strong(larger, std::min(one, other), std::memory_order_relaxed)) return;
  }
}

}  // namespace lamina::load
