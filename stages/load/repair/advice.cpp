// stages/load/repair/advice.cpp: distances are tried on one index; only those that close most edges are repaired with.
#include "stages/load/repair/advice.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "stages/load/load.h"
#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/enclosed.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/weld.h"

namespace lamina::load {
namespace {

/// Triangles that are welded for advice, over all distances.
constexpr std::uint64_t kMaxWelded = std::uint64_t{1} << 24;

std::uint64_t open_edges(std::span<const Side> sides) {
  std::uint64_t open = 0;
  for_each_edge(sides, [&](const Side* begin, const Side* end) { open += end - begin == 1; });
  return open;
}

bool makes_a_solid(const Buffer<Triangle>& triangles, const Box& bounds, std::int64_t distance) {
  Mesh mesh;
  mesh.triangles = triangles;
  mesh.bounds = bounds;
  const RepairReport report = repair(mesh, distance);
  return check_solid(mesh, report) && capped_share(mesh) < 0.1;
}

}  // namespace

Status check_solid(const Mesh& mesh, const RepairReport& report) {
  const auto hollow = [](std::string why) { return Error{Fault::kInput, std::move(why)}; };
  if (mesh.triangles.empty()) return hollow("its facets lie loose and enclose nothing");
  const Enclosed held = enclosed(mesh);
  if (held.nothing()) return hollow("its facets enclose nothing");
  const double before = std::fabs(report.volume_before_mm3);
  if (held.volume_mm3 >= before / 2) return {};
  return hollow(fmt::format("its facets lie apart: closing them leaves {:.4g} of some {:.4g} mm3", held.volume_mm3, before));
}

double weld_uncertainty(const Mesh& mesh, const RepairReport& report) {
  const double volume = std::fabs(census(mesh.triangles, mesh.bounds.middle().z).volume_mm3);
  return report.weld_moved_mm3 > 0 && volume > 0 ? 2 * report.weld_moved_mm3 / volume : 0;
}

std::int64_t weld_that_closes(const Buffer<Triangle>& triangles, const Box& bounds, std::int64_t tried_nm) {
  Indexed indexed = index_mesh(triangles);
  const Buffer<std::uint8_t> repeated = repeats(indexed.facet);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < repeated.size(); ++i)
    if (!repeated[i]) indexed.facet[kept++] = indexed.facet[i];
  indexed.facet.resize(kept);
  const Buffer<Side> sides = sorted_sides(indexed.facet);
  const std::uint64_t open = open_edges(sides);
  const auto maximum = std::min(static_cast<std::int64_t>(diagonal_nm(bounds) / 20), 2 * farthest_weld(indexed));
  std::uint64_t left = std::max(kMaxWelded, 2 * triangles.size());
  for (std::int64_t distance = kWeldByItself; distance <= maximum; distance *= 2) {
    if (distance <= tried_nm) continue;
    if (left < triangles.size()) break;
    left -= triangles.size();
    Indexed welded = indexed;
    Buffer<Side> joined = sides;
    if (weld(welded, joined, distance).joined == 0 || 4 * open_edges(joined) > open) continue;
    if (makes_a_solid(triangles, bounds, distance)) return distance;
  }
  return 0;
}

}  // namespace lamina::load
