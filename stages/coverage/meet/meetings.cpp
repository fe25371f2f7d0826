#include "stages/coverage/meet/meetings.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include "stages/coverage/meet/box_tree.h"
#include "stages/coverage/meet/triangles_meet.h"

namespace lamina::cover {
namespace {

using Wide = __int128;

constexpr std::size_t kMostNeighbours = 4096;
constexpr std::uint32_t kMostRays = 1 << 16;
constexpr std::uint32_t kNobody = UINT32_MAX;

/// Of each facet, numbered cluster * kClusterSize + lane, those behind its three edges.
using Neighbours = Buffer<std::array<std::uint32_t, 3>>;

Box box_of(const Triangle& t) {
  Box box;
  box.add(t.a), box.add(t.b), box.add(t.c);
  return box;
}

struct Facets {
  std::array<Plane, kClusterSize> plane;
  std::array<Box, kClusterSize> box;

  void take(const Cluster& cluster) {
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      plane[i] = Plane(cluster.triangle(i));
      box[i] = box_of(plane[i].facet);
    }
  }
};

/// Looks at all facets near one.
class Surroundings {
 public:
  Surroundings(const Plane& facet, const Box& box, std::uint32_t number) : facet_(facet), box_(box), number_(number) {}

  void look_at(const Facets& others, std::uint32_t first_number) {
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      if (!boxes_touch(box_, others.box[i]) || first_number + i == number_) continue;
      const Plane& other = others.plane[i];
      if (other.flat()) continue;
      int shared = 0;
      if (triangles_meet(facet_, other, shared)) meets_ = true;
      if (shared == 2) note_edge(other.facet, first_number + i);
      if (meets_) return;
    }
  }
  bool suspect() const {
    return meets_ || std::ranges::any_of(behind_, [](std::uint32_t n) { return n == kNobody; });
  }
  const std::array<std::uint32_t, 3>& behind() const { return behind_; }

 private:
  void note_edge(const Triangle& other, std::uint32_t number) {
    const std::array<const Point3*, 3> p{&facet_.facet.a, &facet_.facet.b, &facet_.facet.c}, q{&other.a, &other.b, &other.c};
    for (int i = 0; i < 3; ++i) {
      const Point3 &from = *p[i], &to = *p[(i + 1) % 3];
      for (int k = 0; k < 3; ++k) {
        const Point3 &start = *q[k], &end = *q[(k + 1) % 3];
        if (from == start && to == end) meets_ = true;
        if (from != end || to != start) continue;
        if (behind_[i] != kNobody) meets_ = true;
        behind_[i] = number;
      }
    }
  }

  const Plane& facet_;
  const Box& box_;
  std::uint32_t number_;
  bool meets_ = false;
  std::array<std::uint32_t, 3> behind_{kNobody, kNobody, kNobody};
};

void look_around(const MeshBlocks& mesh, const BoxTree& tree, std::uint32_t cluster, std::uint16_t& suspects,
                 Neighbours& neighbours) {
  std::vector<std::uint32_t> near;
  tree.each(mesh.bounds()[cluster], [&](std::uint32_t other) { near.push_back(other); });
  suspects = 0;
  if (near.size() > kMostNeighbours) {
    suspects = 0xFFFF;
    return;
  }
  Cluster room;
  Facets own, others;
  own.take(mesh.cluster(cluster, room));
  std::vector<Surroundings> all;
  for (std::uint32_t i = 0; i < kClusterSize; ++i) all.emplace_back(own.plane[i], own.box[i], cluster * kClusterSize + i);
  for (const std::uint32_t other : near) {
    others.take(mesh.cluster(other, room));
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      if (own.plane[i].flat() || !boxes_touch(own.box[i], mesh.bounds()[other])) continue;
      all[i].look_at(others, other * kClusterSize);
    }
  }
  for (std::uint32_t i = 0; i < kClusterSize; ++i) {
    if (own.plane[i].flat()) continue;
    neighbours[std::size_t{cluster} * kClusterSize + i] = all[i].behind();
    if (all[i].suspect()) suspects = static_cast<std::uint16_t>(suspects | 1u << i);
  }
}

/// Where a line along x at an odd half-nanometre of y and z crosses a facet: whole + rest / divisor half-nanometres.
struct Hit {
  bool crosses = false;
  std::int64_t whole = 0;
  Wide rest = 0, divisor = 1;
};

Hit hit(const Plane& plane, std::int64_t y, std::int64_t z) {
  Hit result;
  const std::array<const Point3*, 3> p{&plane.facet.a, &plane.facet.b, &plane.facet.c};
  int turns = 0;
  for (int i = 0; i < 3; ++i) {
    const Point3 &a = *p[i], &b = *p[(i + 1) % 3];
    const Wide turn = static_cast<Wide>(2 * (std::int64_t{b.y} - a.y)) * (z - 2 * std::int64_t{a.z}) -
                      static_cast<Wide>(2 * (std::int64_t{b.z} - a.z)) * (y - 2 * std::int64_t{a.y});
    turns += turn > 0 ? 1 : turn < 0 ? -1 : 0;
  }
  if (plane.nx == 0 || std::abs(turns) != 3) {
    result.divisor = turns == 0 || std::abs(turns) == 1 ? 1 : 0;  // 0: on an edge, nobody can tell
    return result;
  }
  const Point3& a = plane.facet.a;
  Wide fall =
      static_cast<Wide>(plane.ny) * (y - 2 * std::int64_t{a.y}) + static_cast<Wide>(plane.nz) * (z - 2 * std::int64_t{a.z});
  fall = plane.nx > 0 ? -fall : fall;
  result.crosses = true;
  result.divisor = plane.nx > 0 ? static_cast<Wide>(plane.nx) : -static_cast<Wide>(plane.nx);
  const Wide whole = floor_div(fall, result.divisor);
  result.whole = 2 * std::int64_t{a.x} + static_cast<std::int64_t>(whole);
  result.rest = fall - whole * result.divisor;
  return result;
}

int compare(const Hit& a, const Hit& b) {
  if (a.whole != b.whole) return a.whole < b.whole ? -1 : 1;
  const Wide left = a.rest * b.divisor, right = b.rest * a.divisor;
  return left < right ? -1 : left > right ? 1 : 0;
}

/// Whether the winding number in front of the facet is 0, for certain.
bool has_nothing_before_it(const MeshBlocks& mesh, const SlabIndex& index, const Plane& facet, std::uint32_t number) {
  const Triangle& t = facet.facet;
  const auto middle = [](std::int64_t a, std::int64_t b, std::int64_t c) {
    return 2 * floor_div(a + b + c, std::int64_t{3}) + 1;
  };
  const std::int64_t y = middle(t.a.y, t.b.y, t.c.y), z = middle(t.a.z, t.b.z, t.c.z);
  const Hit own = hit(facet, y, z);
  if (!own.crosses) return false;
  std::int64_t winding = facet.nx > 0 ? -1 : 0;  // in front of a facet that +x leaves through lies what is behind all others
  bool certain = true;
  Cluster room;
  index.each(floor_div(z, std::int64_t{2}), floor_div(z, std::int64_t{2}) + 1, [&](std::uint32_t c) {
    const Box& box = mesh.bounds()[c];
    if (!certain || 2 * std::int64_t{box.lo.y} > y || 2 * std::int64_t{box.hi.y} < y ||
        2 * std::int64_t{box.lo.x} > own.whole + 1) {
      return;
    }
    const Cluster& cluster = mesh.cluster(c, room);
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      if (c * kClusterSize + i == number) continue;
      const Box of_facet = box_of(cluster.triangle(i));
      if (2 * std::int64_t{of_facet.lo.y} > y || 2 * std::int64_t{of_facet.hi.y} < y || 2 * std::int64_t{of_facet.lo.z} > z ||
          2 * std::int64_t{of_facet.hi.z} < z) {
        continue;
      }
      const Plane other(cluster.triangle(i));
      if (other.flat() || other.nx == 0) continue;
      const Hit at = hit(other, y, z);
      if (at.divisor == 0) certain = false;
      if (!at.crosses) continue;
      const int order = compare(at, own);
      if (order == 0) certain = false;
      if (order < 0) winding += other.nx < 0 ? 1 : -1;
    }
  });
  return certain && winding == 0;
}

/// Shells of facets that are not suspect yet become suspect unless nothing is in front of them.
void judge_shells(const MeshBlocks& mesh, const SlabIndex& index, const Neighbours& neighbours, Suspects& suspects) {
  const auto is_suspect = [&](std::uint32_t f) { return (suspects[f / kClusterSize] >> f % kClusterSize & 1) != 0; };
  std::vector<bool> seen(neighbours.size());
  std::vector<std::uint32_t> shell;
  std::uint32_t rays = 0;
  for (std::uint32_t first = 0; first < neighbours.size(); ++first) {
    if (seen[first] || is_suspect(first) || neighbours[first][0] == kNobody) continue;
    shell.assign(1, first);
    seen[first] = true;
    std::uint32_t widest = first;
    double most = -1;
    for (std::size_t i = 0; i < shell.size(); ++i) {
      const double width =
          std::abs(static_cast<double>(Plane(mesh.triangle(shell[i] / kClusterSize, shell[i] % kClusterSize)).nx));
      if (width > most) most = width, widest = shell[i];
      for (const std::uint32_t next : neighbours[shell[i]]) {
        if (seen[next] || is_suspect(next)) continue;
        seen[next] = true;
        shell.push_back(next);
      }
    }
    const Plane facet(mesh.triangle(widest / kClusterSize, widest % kClusterSize));
    if (rays++ < kMostRays && has_nothing_before_it(mesh, index, facet, widest)) continue;
    for (const std::uint32_t f : shell) {
      std::uint16_t& of_cluster = suspects[f / kClusterSize];
      of_cluster = static_cast<std::uint16_t>(of_cluster | 1u << f % kClusterSize);
    }
  }
}

}  // namespace

Suspects find_suspects(const MeshBlocks& mesh, const SlabIndex& index) {
  const std::uint32_t clusters = mesh.cluster_count();
  Suspects suspects;
  suspects.assign(clusters, 0);
  Neighbours neighbours;
  neighbours.assign(std::size_t{clusters} * kClusterSize, {kNobody, kNobody, kNobody});
  const BoxTree tree(mesh.bounds());
  tbb::parallel_for(std::uint32_t{0}, clusters, [&](std::uint32_t c) { look_around(mesh, tree, c, suspects[c], neighbours); });
  judge_shells(mesh, index, neighbours, suspects);
  return suspects;
}

}  // namespace lamina::cover
