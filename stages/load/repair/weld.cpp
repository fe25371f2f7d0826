// stages/load/repair/weld.cpp: a sweep along x over the vertices, which are sorted already.
#include "stages/load/repair/weld.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace lamina::load {
namespace {

bool within(const Point3& p, const Point3& q, std::int64_t distance) {
  const std::int64_t dx = std::int64_t{p.x} - q.x, dy = std::int64_t{p.y} - q.y, dz = std::int64_t{p.z} - q.z;
  if (std::abs(dx) > distance || std::abs(dy) > distance || std::abs(dz) > distance) return false;
  // Each term is below 2^62 for distances within 1 m, which is far more than anybody welds.
  return dx * dx + dy * dy + dz * dz <= distance * distance;
}

}  // namespace

Welding find_welding(const Indexed& mesh, std::span<const Side> sides, std::int64_t weld_nm) {
  weld_nm = std::min<std::int64_t>(weld_nm, 1'000'000'000);
  Welding welding;
  welding.target.resize(mesh.vertex.size());
  std::iota(welding.target.begin(), welding.target.end(), 0u);

  Buffer<std::uint32_t> loose;
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    if ((end - begin) % 2 == 0) return;
    loose.push_back(begin->low);
    loose.push_back(begin->high);
  });
  std::sort(loose.begin(), loose.end());
  loose.erase(std::unique(loose.begin(), loose.end()), loose.end());

  const auto joined_by_edge = [&](std::uint32_t low, std::uint32_t high) {
    const auto found = std::lower_bound(sides.begin(), sides.end(), std::array{low, high},
                                        [](const Side& side, const std::array<std::uint32_t, 2>& edge) {
                                          return std::array{side.low, side.high} < edge;
                                        });
    return found != sides.end() && found->low == low && found->high == high;
  };

  // Columns of cells in y and z, so that a vertex meets only those nearby: sorted by cell, then as before.
  struct Placed {
    std::int64_t y, z;
    std::uint32_t vertex;
  };
  const auto cell = [&](const Point3& p) {
    return std::array{floor_div<std::int64_t>(p.y, weld_nm), floor_div<std::int64_t>(p.z, weld_nm)};
  };
  Buffer<Placed> placed;
  for (const std::uint32_t vertex : loose) {
    const auto [y, z] = cell(mesh.vertex[vertex]);
    placed.push_back({y, z, vertex});
  }
  const auto before = [&](const Placed& one, const Placed& other) {
    return std::tie(one.y, one.z, one.vertex) < std::tie(other.y, other.z, other.vertex);
  };
  std::sort(placed.begin(), placed.end(), before);

  Buffer<std::uint8_t> taken(mesh.vertex.size());
  std::fill(taken.begin(), taken.end(), std::uint8_t{0});
  for (const std::uint32_t leader : loose) {
    if (taken[leader]) continue;
    taken[leader] = 1;
    const Point3& centre = mesh.vertex[leader];
    const auto [y, z] = cell(centre);
    for (std::int64_t dy = -1; dy <= 1; ++dy) {
      for (std::int64_t dz = -1; dz <= 1; ++dz) {
        // Vertices before the leader in x are leaders or taken, so only those after it are looked at.
        auto at = std::lower_bound(placed.begin(), placed.end(), Placed{y + dy, z + dz, leader}, before);
        for (; at != placed.end() && at->y == y + dy && at->z == z + dz; ++at) {
          const Point3& point = mesh.vertex[at->vertex];
          if (std::int64_t{point.x} - centre.x > weld_nm) break;
          if (taken[at->vertex] || !within(point, centre, weld_nm) || joined_by_edge(leader, at->vertex)) continue;
          taken[at->vertex] = 1;
          welding.target[at->vertex] = leader;
          ++welding.moved;
        }
      }
    }
  }
  return welding;
}

}  // namespace lamina::load
