#include "stages/checks/crossed.h"

#include <algorithm>
#include <set>
#include <utility>

namespace lamina::sanity {

std::vector<std::uint8_t> crossed_planes(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                         std::span<const Nm> planes) {
  std::vector<std::uint8_t> crossed(planes.size(), 0);
  std::set<std::pair<std::uint32_t, Nm>> seen;
  for (const Instance& instance : instances) {
    if (!seen.emplace(instance.mesh, instance.offset.z).second) continue;
    for (const Triangle& t : meshes[instance.mesh].triangles) {
      const std::int64_t lowest = std::int64_t{std::min({t.a.z, t.b.z, t.c.z})} + instance.offset.z,
                         highest = std::int64_t{std::max({t.a.z, t.b.z, t.c.z})} + instance.offset.z;
      auto plane = std::ranges::lower_bound(planes, lowest);
      for (; plane != planes.end() && *plane < highest; ++plane) crossed[static_cast<std::size_t>(plane - planes.begin())] = 1;
    }
  }
  return crossed;
}

}  // namespace lamina::sanity
