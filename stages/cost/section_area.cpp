#include "stages/cost/section_area.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lamina::cost {
namespace {

using CutCorner = std::array<double, 3>;  // mm

/// Twice the signed area between the origin and the cut of a triangle with a plane, walked with the solid on its left.
double swept(const std::array<CutCorner, 3>& corners, double z) {
  std::array<double, 2> from{}, to{};
  for (std::size_t i = 0; i < 3; ++i) {
    const CutCorner& a = corners[i];
    const CutCorner& b = corners[(i + 1) % 3];
    if ((a[2] < z) == (b[2] < z)) continue;
    const double t = (z - a[2]) / (b[2] - a[2]);
    // A corner of the cut on an edge that goes up is its end: viewed from outside, the solid is on the left.
    (a[2] < z ? to : from) = std::array{a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])};
  }
  return from[0] * to[1] - from[1] * to[0];
}

}  // namespace

std::vector<double> section_areas(std::span<const Mesh> meshes, std::span<const Instance> instances, std::size_t count) {
  std::int64_t bottom = INT64_MAX, top = INT64_MIN;
  for (const Instance& instance : instances) {
    bottom = std::min(bottom, std::int64_t{meshes[instance.mesh].bounds.lo.z} + instance.offset.z);
    top = std::max(top, std::int64_t{meshes[instance.mesh].bounds.hi.z} + instance.offset.z);
  }
  std::vector<double> areas(count);
  if (bottom >= top) return areas;
  const double low = mm(bottom), step = mm(top - bottom) / static_cast<double>(count);
  for (const Instance& instance : instances) {
    const Point3& by = instance.offset;
    const auto at = [&](const Point3& p) {
      return CutCorner{mm(std::int64_t{p.x} + by.x), mm(std::int64_t{p.y} + by.y), mm(std::int64_t{p.z} + by.z)};
    };
    for (const Triangle& t : meshes[instance.mesh].triangles) {
      const std::array<CutCorner, 3> corners{at(t.a), at(t.b), at(t.c)};
      const auto [lowest, highest] = std::minmax({corners[0][2], corners[1][2], corners[2][2]});
      const double first = std::max(0.0, std::ceil((lowest - low) / step - 0.5));
      for (auto i = static_cast<std::size_t>(first); i < count; ++i) {
        const double z = low + (static_cast<double>(i) + 0.5) * step;
        if (z > highest) break;
        areas[i] += swept(corners, z) / 2;
      }
    }
  }
  for (double& area : areas) area = std::abs(area);
  return areas;
}

}  // namespace lamina::cost
