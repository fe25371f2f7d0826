#include "tests/fuzz/laws.h"

#include <array>
#include <tuple>
#include <vector>

namespace lamina::fuzz {
namespace {

/// Whether every edge is walked as often one way as the other, by sorting: slower than the census, and sure.
bool balanced(const Mesh& mesh) {
  struct Edge {
    Point3 lo, hi;
    int sign;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles) {
    const std::array<std::array<Point3, 2>, 3> sides = {{{t.a, t.b}, {t.b, t.c}, {t.c, t.a}}};
    for (const auto& [from, to] : sides) {
      if (from != to) edges.push_back(from < to ? Edge{from, to, 1} : Edge{to, from, -1});
    }
  }
  std::ranges::sort(edges, [](const Edge& a, const Edge& b) { return std::tie(a.lo, a.hi) < std::tie(b.lo, b.hi); });
  for (std::size_t i = 0; i < edges.size();) {
    int sum = 0;
    std::size_t j = i;
    for (; j < edges.size() && edges[j].lo == edges[i].lo && edges[j].hi == edges[i].hi; ++j) sum += edges[j].sign;
    if (sum != 0) return false;
    i = j;
  }
  return true;
}

void check_mesh(const Mesh& mesh, bool repaired) {
  Box box;
  for (const Triangle& t : mesh.triangles) {
    for (const Point3& corner : {t.a, t.b, t.c}) box.add(corner);
  }
  law(box.lo == mesh.bounds.lo && box.hi == mesh.bounds.hi, "bounds of a mesh are not those of its corners");
  law(mesh.closed == balanced(mesh), "a mesh is called closed and is not, or the other way round");
  law(mesh.closed || !repaired, "repair left a mesh open");
}

}  // namespace

void check_part(const Part& part, std::uint64_t triangle_limit, bool repaired) {
  law(!part.meshes.empty() && !part.instances.empty(), "a part without meshes");
  std::uint64_t triangles = 0;
  for (const Mesh& mesh : part.meshes) {
    check_mesh(mesh, repaired);
    triangles += std::min<std::uint64_t>(mesh.repaired_from, mesh.triangles.size());
  }
  law(triangles <= triangle_limit, "more triangles than the limit");
  Box box;
  for (const Instance& instance : part.instances) {
    law(instance.mesh < part.meshes.size(), "an instance of no mesh");
    const Box& own = part.meshes[instance.mesh].bounds;
    if (own.empty()) continue;
    for (const Point3& corner : {own.lo, own.hi}) {
      const std::array<std::int64_t, 3> at = {std::int64_t{corner.x} + instance.offset.x,
                                              std::int64_t{corner.y} + instance.offset.y,
                                              std::int64_t{corner.z} + instance.offset.z};
      for (const std::int64_t v : at) law(v >= -kNmReach && v <= kNmReach, "beyond reach");
      box.add(Point3{static_cast<Nm>(at[0]), static_cast<Nm>(at[1]), static_cast<Nm>(at[2])});
    }
  }
  law(box.lo == part.bounds.lo && box.hi == part.bounds.hi, "bounds of a part are not those of its instances");
  law(part.bounds.width() > 0 && part.bounds.depth() > 0 && part.bounds.height() > 0, "a flat part");
  for (const Note& note : part.notes) check_line(note.text);
}

}  // namespace lamina::fuzz
