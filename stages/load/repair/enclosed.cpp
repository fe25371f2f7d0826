// stages/load/repair/enclosed.cpp: volumes of pieces, and facets with reversed twins.
#include "stages/load/repair/enclosed.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "stages/load/repair/geometry.h"
#include "stages/load/repair/topology.h"

namespace lamina::load {

Enclosed enclosed(const Mesh& mesh) {
  const Indexed indexed = index_mesh(mesh.triangles);
  DisjointSets pieces(indexed.vertex.size());
  for (const Indexed::Facet& facet : indexed.facet) {
    pieces.join(facet[0], facet[1]);
    pieces.join(facet[1], facet[2]);
  }
  Buffer<double> volume(indexed.vertex.size(), 0.0);
  Enclosed result;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (collapsed(indexed.facet[i])) continue;
    // Every piece is closed, so the tip of its pyramids may be anywhere: near by, so that little cancels out.
    const std::uint32_t piece = pieces.find(indexed.facet[i][0]);
    volume[piece] += static_cast<double>(sixfold_volume(mesh.triangles[i], indexed.vertex[piece]));
    result.area_mm2 += doubled_area_length(mesh.triangles[i]) / 2e12;
  }
  for (const double sixfold : volume) result.volume_mm3 += std::fabs(sixfold) / 6e18;
  return result;
}

namespace {

struct Key {
  Indexed::Facet corner;  // in rising order
  std::uint32_t facet;
  bool even;  // the facet runs through them in this order
};

/// For each facet whether it has a reversed twin of its own.
Buffer<std::uint8_t> reversed_twins(const Indexed& mesh) {
  Buffer<Key> keys;
  for (std::uint32_t f = 0; f < mesh.facet.size(); ++f) {
    if (collapsed(mesh.facet[f])) continue;
    Indexed::Facet corner = mesh.facet[f];
    std::rotate(corner.begin(), std::min_element(corner.begin(), corner.end()), corner.end());
    const bool even = corner[1] < corner[2];
    if (!even) std::swap(corner[1], corner[2]);
    keys.push_back({corner, f, even});
  }
  tbb::parallel_sort(keys.begin(), keys.end(), [](const Key& one, const Key& other) {
    return std::tie(one.corner, one.even, one.facet) < std::tie(other.corner, other.even, other.facet);
  });
  Buffer<std::uint8_t> twin(mesh.facet.size(), std::uint8_t{0});
  for (std::size_t begin = 0, end = 0; begin < keys.size(); begin = end) {
    std::size_t odd = begin;
    while (odd < keys.size() && keys[odd].corner == keys[begin].corner && !keys[odd].even) ++odd;
    end = odd;
    while (end < keys.size() && keys[end].corner == keys[begin].corner) ++end;
    const std::size_t pairs = std::min(odd - begin, end - odd);
    for (std::size_t i = 0; i < pairs; ++i) twin[keys[begin + i].facet] = twin[keys[odd + i].facet] = 1;
  }
  return twin;
}

}  // namespace

Cancelled find_cancelled(const Mesh& mesh) {
  Cancelled cancelled;
  const Indexed indexed = index_mesh(mesh.triangles);
  const Buffer<std::uint8_t> twin = reversed_twins(indexed);
  DisjointSets shells(indexed.facet.size());
  const Buffer<Side> sides = sorted_sides(indexed.facet);
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    for (const Side* side = begin + 1; side < end; ++side) shells.join(begin->facet, side->facet);
  });
  Buffer<std::uint8_t> stays(indexed.facet.size(), 0);  // by representative
  for (std::uint32_t f = 0; f < twin.size(); ++f)
    if (!twin[f] && !collapsed(indexed.facet[f])) stays[shells.find(f)] = 1;
  std::uint32_t first = UINT32_MAX;
  for (std::uint32_t f = 0; f < twin.size(); ++f) {
    const std::uint32_t shell = shells.find(f);
    if (collapsed(indexed.facet[f]) || stays[shell]) continue;
    ++cancelled.facets;
    cancelled.shells += shell == f;
    first = std::min(first, shell);
    if (shell != first) continue;
    for (const Point3& corner : {mesh.triangles[f].a, mesh.triangles[f].b, mesh.triangles[f].c}) cancelled.box.add(corner);
  }
  return cancelled;
}

}  // namespace lamina::load
