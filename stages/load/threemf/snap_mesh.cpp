#include "stages/load/threemf/snap_mesh.h"

#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>

#include "stages/load/matrix.h"

namespace lamina::load {
namespace {

using BlockedRange = tbb::blocked_range<std::size_t>;

struct SnappedVertices {
  Buffer<Point3> at;
  Buffer<Snapped> how;
  std::array<double, 3> margin;
};

std::array<double, 3> minimum(const std::array<double, 3>& one, const std::array<double, 3>& other) {
  return {std::min(one[0], other[0]), std::min(one[1], other[1]), std::min(one[2], other[2])};
}

SnappedVertices snap_vertices(const ModelObject& object, const Transform& transform) {
  const Snapper snapper(transform, 1.0);
  SnappedVertices out;
  const std::size_t count = object.vertices.size();
  out.at.resize(count);
  out.how.resize(count);
  out.margin = tbb::parallel_reduce(
      BlockedRange(0, count, 1 << 13), std::array<double, 3>{0.5, 0.5, 0.5},
      [&](const BlockedRange& range, std::array<double, 3> margin) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const auto& v = object.vertices[i];
          Point3& p = out.at[i];
          out.how[i] = snapper.snap(v[0], v[1], v[2], p);
          if (out.how[i] != Snapped::kYes) continue;
          const std::array<double, 3> moved = apply(transform.linear, v);
          const std::array<Nm, 3> whole{p.x, p.y, p.z};
          for (std::size_t axis = 0; axis < 3; ++axis) {
            const double nm = (moved[axis] + transform.translation[axis]) * 1e6;
            margin[axis] = std::min(margin[axis], 0.5 - std::fabs(nm - static_cast<double>(whole[axis])));
          }
        }
        return margin;
      },
      minimum);
  return out;
}

struct GatheredFacets {
  Box bounds;
  bool bad = false;  // a triangle has a corner that cannot be snapped
};

}  // namespace

Result<SnappedMesh> snap_mesh(const Source& source, const ModelObject& object, const std::string& label,
                              const Transform& transform, const LoadOptions& options) {
  const SnappedVertices vertices = snap_vertices(object, transform);
  const bool mirrors = transform.mirrors();
  SnappedMesh mesh;
  mesh.margin = vertices.margin;
  Buffer<Triangle>& triangles = mesh.facets.triangles;
  const std::size_t count = object.triangles.size();
  triangles.resize(count);
  const auto is = [&](std::size_t i) {
    const auto& [a, b, c] = object.triangles[i];
    return std::max({vertices.how[a], vertices.how[b], vertices.how[c]});
  };
  const GatheredFacets gathered = tbb::parallel_reduce(
      BlockedRange(0, count, 1 << 13), GatheredFacets{},
      [&](const BlockedRange& range, GatheredFacets so_far) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const auto& [a, b, c] = object.triangles[i];
          Triangle& t = triangles[i];
          t = {vertices.at[a], vertices.at[mirrors ? c : b], vertices.at[mirrors ? b : c]};
          if (is(i) != Snapped::kYes)
            so_far.bad = true;
          else
            so_far.bounds.add(t.a), so_far.bounds.add(t.b), so_far.bounds.add(t.c);
        }
        return so_far;
      },
      [](GatheredFacets one, const GatheredFacets& other) {
        one.bounds.add(other.bounds);
        one.bad = one.bad || other.bad;
        return one;
      });
  mesh.facets.bounds = gathered.bounds;
  if (!gathered.bad) return mesh;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Snapped snapped = is(i);
    if (snapped == Snapped::kYes)
      triangles[kept++] = triangles[i];
    else if (snapped == Snapped::kBeyondReach || !options.drop_bad)
      return source.error(fmt::format("{}, triangle {}: {}", label, i + 1, what_is_wrong(snapped)));
  }
  triangles.resize(kept);
  mesh.facets.notes.push_back({true, fmt::format("{} triangles with coordinates that are not finite dropped", count - kept)});
  return mesh;
}

}  // namespace lamina::load
