// stages/load/repair/diagnose.cpp: counts and places of everything that keeps a mesh from being a plain solid.
#include "stages/load/repair/diagnose.h"

#include <algorithm>
#include <array>

#include "stages/load/repair/geometry.h"
#include "stages/load/repair/overlaps.h"
#include "stages/load/repair/topology.h"

namespace lamina::load {
namespace {

Point3 middle(const Point3& p, const Point3& q) {
  const auto half = [](Nm one, Nm other) { return static_cast<Nm>((std::int64_t{one} + other) / 2); };
  return {half(p.x, q.x), half(p.y, q.y), half(p.z, q.z)};
}

/// Counts, and keeps the `places` with the smallest triangles.
class Collector {
 public:
  Collector(Diagnosis::Finding& finding, std::size_t places) : finding_(finding), places_(places) {}
  void add(std::uint32_t triangle, const Point3& at) {
    ++finding_.count;
    auto& first = finding_.first;
    if (first.size() == places_ && (places_ == 0 || first.back().triangle <= triangle)) return;
    if (first.size() == places_) first.pop_back();
    const auto behind = std::upper_bound(first.begin(), first.end(), triangle,
                                         [](std::uint32_t value, const auto& place) { return value < place.triangle; });
    first.insert(behind, {triangle, at});
  }

 private:
  Diagnosis::Finding& finding_;
  std::size_t places_;
};

struct Shell {
  Int128 volume = 0;  // sixfold
  Box box;
  bool closed = true;
};

/// More ends than this say little.
constexpr std::size_t kMostEnds = 64;

void describe_shells(std::span<const Shell> shells, Diagnosis& result) {
  result.shells = static_cast<std::uint32_t>(shells.size());
  Int128 outward = 0;
  std::vector<Box> boxes;
  for (const Shell& shell : shells) {
    if (shell.closed && shell.volume < 0) ++result.inverted_shells;
    outward += shell.volume < 0 ? -shell.volume : shell.volume;
    boxes.push_back(shell.box);
  }
  result.outward_mm3 = static_cast<double>(outward) / 6e18;
  result.shells_apart = result.non_manifold_edges.count == 0;
  const bool all_seen =
      !result.shells_apart || for_each_overlap(boxes, [&](auto, auto) { return result.shells_apart = false; });
  result.shells_apart = result.shells_apart && all_seen;
  const bool many = 2 * boxes.size() > kMostEnds;
  for (const Box& box : many ? std::span<const Box>(&result.bounds, 1) : std::span<const Box>(boxes)) {
    result.shell_ends.push_back(box.lo.z);
    result.shell_ends.push_back(box.hi.z);
  }
  std::ranges::sort(result.shell_ends);
  result.shell_ends.erase(std::unique(result.shell_ends.begin(), result.shell_ends.end()), result.shell_ends.end());
}

}  // namespace

Diagnosis diagnose(const Mesh& mesh, std::size_t places) {
  Diagnosis result;
  const auto& triangles = mesh.triangles;
  result.triangles = triangles.size();
  const Indexed indexed = index_mesh(triangles);
  result.vertices = indexed.vertex.size();

  Collector degenerate(result.degenerate_facets, places), duplicate(result.duplicate_facets, places);
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    for (const Point3& corner : {triangles[i].a, triangles[i].b, triangles[i].c}) result.bounds.add(corner);
    if (!has_area(triangles[i])) degenerate.add(i, triangles[i].a);
  }
  const Buffer<std::uint8_t> repeated = repeats(indexed.facet);
  for (std::uint32_t i = 0; i < triangles.size(); ++i)
    if (repeated[i]) duplicate.add(i, triangles[i].a);

  Collector open(result.open_edges, places), non_manifold(result.non_manifold_edges, places),
      misoriented(result.misoriented_edges, places);
  const Buffer<Side> sides = sorted_sides(indexed.facet);
  DisjointSets shells(triangles.size());
  Buffer<std::uint8_t> unbalanced_facet(triangles.size());
  std::fill(unbalanced_facet.begin(), unbalanced_facet.end(), std::uint8_t{0});
  result.balanced = true;
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    ++result.edges;
    for (const Side* side = begin + 1; side < end; ++side) shells.join(begin->facet, side->facet);
    const Point3 at = middle(indexed.vertex[begin->low], indexed.vertex[begin->high]);
    if (end - begin == 1) open.add(begin->facet, at);
    if (end - begin > 2) non_manifold.add(begin->facet, at);
    if (end - begin == 2 && begin[0].forward == begin[1].forward) misoriented.add(begin->facet, at);
    if (surplus(begin, end) != 0) {
      result.balanced = false;
      for (const Side* side = begin; side != end; ++side) unbalanced_facet[side->facet] = 1;
    }
  });

  std::vector<Shell> by_representative(triangles.size());
  Int128 volume = 0;
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    if (collapsed(indexed.facet[i])) continue;
    Shell& shell = by_representative[shells.find(i)];
    const Int128 part = sixfold_volume(triangles[i], result.bounds.lo);
    shell.volume += part;
    for (const Point3& corner : {triangles[i].a, triangles[i].b, triangles[i].c}) shell.box.add(corner);
    volume += part;
    if (unbalanced_facet[i]) shell.closed = false;
  }
  std::erase_if(by_representative, [](const Shell& shell) { return shell.box.empty(); });
  result.volume_mm3 = static_cast<double>(volume) / 6e18;
  describe_shells(by_representative, result);
  return result;
}

}  // namespace lamina::load
