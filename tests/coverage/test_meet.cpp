// Kernels on pairs of facets compared with an exact test of each pair in whole numbers, of facets that share, touch and
// cross.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <set>
#include <tuple>
#include <vector>

#include "stages/coverage/meet/facet_group.h"
#include "stages/geometry/isa.h"
#include "tests/program/machines.h"

namespace lamina::coverage {
namespace {

struct Vector {
  std::int64_t x, y, z;
  friend Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vector operator*(std::int64_t k, const Vector& a) { return {k * a.x, k * a.y, k * a.z}; }
};
Vector cross_of(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
std::int64_t dot_of(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vector vector_of(const Point3& p) { return {p.x, p.y, p.z}; }

/// Whether two convex hulls, of a triangle and of a triangle or segment, have a point in common: no axis parts them. Their
/// faces' normals, those of edges within faces, and products of two edges are all that matter.
bool hulls_meet(const std::vector<Vector>& a, const std::vector<Vector>& b) {
  const auto sides = [](const std::vector<Vector>& of) {
    std::vector<Vector> all;
    for (std::size_t i = 0; i < of.size(); ++i) all.push_back(of[(i + 1) % of.size()] - of[i]);
    return all;
  };
  std::vector<Vector> axes;
  const std::vector<Vector> of_a = sides(a), of_b = sides(b);
  for (const Vector& e : of_a) {
    for (const Vector& h : of_b) axes.push_back(cross_of(e, h));
  }
  for (const auto* of : {&of_a, &of_b}) {
    const Vector normal = cross_of((*of)[0], (*of)[1]);
    axes.push_back(normal);
    for (const auto* edges : {&of_a, &of_b}) {
      for (const Vector& e : *edges) axes.push_back(cross_of(normal, e));
    }
  }
  return std::ranges::none_of(axes, [&](const Vector& axis) {
    std::int64_t low_a = INT64_MAX, high_a = INT64_MIN, low_b = INT64_MAX, high_b = INT64_MIN;
    for (const Vector& p : a) low_a = std::min(low_a, dot_of(axis, p)), high_a = std::max(high_a, dot_of(axis, p));
    for (const Vector& p : b) low_b = std::min(low_b, dot_of(axis, p)), high_b = std::max(high_b, dot_of(axis, p));
    return low_a > high_b || low_b > high_a;
  });
}

/// Of facets that share at most one corner: with one, whether a ray from it lies in both.
bool meet_beyond(const Triangle& f, const Triangle& g) {
  const std::array<Point3, 3> p{f.a, f.b, f.c}, q{g.a, g.b, g.c};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (p[i] != q[k]) continue;
      const Vector v = vector_of(p[i]);
      const auto far = [&](const Point3& to) { return v + 1000 * (vector_of(to) - v); };
      return hulls_meet({v, far(p[(i + 1) % 3]), far(p[(i + 2) % 3])}, {vector_of(q[(k + 1) % 3]), vector_of(q[(k + 2) % 3])});
    }
  }
  return hulls_meet({vector_of(f.a), vector_of(f.b), vector_of(f.c)}, {vector_of(g.a), vector_of(g.b), vector_of(g.c)});
}

using EdgePair = std::tuple<int, int, int, int>;
using Pair = std::pair<int, int>;
struct Reported {
  std::set<EdgePair> edges;
  std::set<Pair> uncertain, alike;
  bool operator==(const Reported&) const = default;
};
Reported predicted_lines(const PairKernels& kernels, const FacetGroup& a, const FacetGroup& b, const Box& around_b) {
  const auto found = std::make_unique<FoundPairs>();
  kernels.pairs(a, b, around_b, *found);
  Reported reported;
  for (std::uint32_t i = 0; i < found->edges; ++i) {
    const auto& edge = found->edge[i];
    EXPECT_TRUE(reported.edges.insert({edge.a, edge.b, edge.edge_a, edge.edge_b}).second);
  }
  for (std::uint32_t i = 0; i < found->uncertain_count; ++i)
    reported.uncertain.insert({found->uncertain[i].a, found->uncertain[i].b});
  for (std::uint32_t i = 0; i < found->alikes; ++i) reported.alike.insert({found->alike[i].a, found->alike[i].b});
  return reported;
}

/// The reported relation of two facets is true. returns  whether planes separated them
bool check_pair(const Triangle& f, const Triangle& g, const Pair& pair, const Reported& reported) {
  const std::array<Point3, 3> p{f.a, f.b, f.c}, q{g.a, g.b, g.c};
  int shared = 0;
  bool alike = false;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      shared += p[i] == q[k] ? 1 : 0;
      alike |= p[i] == q[k] && p[(i + 1) % 3] == q[(k + 1) % 3];
      const bool opposite = p[i] == q[(k + 1) % 3] && p[(i + 1) % 3] == q[k];
      EXPECT_EQ(reported.edges.contains({pair.first, pair.second, i, k}), opposite);
    }
  }
  EXPECT_EQ(reported.alike.contains(pair), alike);
  if (reported.uncertain.contains(pair)) return false;
  if (shared < 2) {
    EXPECT_FALSE(meet_beyond(f, g));
  }
  EXPECT_LT(shared, 3);
  if (shared == 2) {
    const Plane one(f), other(g);
    EXPECT_GT(one.nx * other.nx + one.ny * other.ny + one.nz * other.nz, 0);
  }
  return shared < 2;
}

TEST(Meet, KernelsPartOnlyFacetsThatDoNotMeetBeyondWhatTheyShare) {
  program::testing::Random random(5);
  std::size_t parted = 0, shared = 0;
  for (int round = 0; round < 300; ++round) {
    const std::uint32_t side = 2 + random() % 7;
    FacetGroup group[2];
    Box around[2];
    std::vector<Triangle> facets[2];
    for (int which = 0; which < 2; ++which) {
      group[which].start();
      while (group[which].used < 5 + static_cast<std::uint32_t>(round) % 12) {
        const auto point = [&] {
          return Point3{static_cast<Nm>(random() % side), static_cast<Nm>(random() % side), static_cast<Nm>(random() % side)};
        };
        const Triangle t{point(), point(), point()};
        if (Plane(t).flat()) continue;
        group[which].add(t, 0);
        facets[which].push_back(t);
        around[which].add(t.a), around[which].add(t.b), around[which].add(t.c);
      }
    }
    for (const int other : {0, 1}) {
      const Reported plain = predicted_lines(pair_kernels_for(Isa::kPlain), group[0], group[other], around[other]);
      for (const Isa isa : {Isa::kAvx2, Isa::kAvx512}) {
        EXPECT_EQ(predicted_lines(pair_kernels_for(limited_isa(isa)), group[0], group[other], around[other]), plain);
      }
      shared += plain.edges.size();
      for (std::uint32_t i = 0; i < facets[0].size(); ++i) {
        for (std::uint32_t k = other == 0 ? i + 1 : 0; k < facets[other].size(); ++k) {
          parted += check_pair(facets[0][i], facets[other][k], {i, k}, plain) ? 1 : 0;
        }
      }
    }
  }
  EXPECT_GT(parted, 10'000u);
  EXPECT_GT(shared, 1'000u);
}

}  // namespace
}  // namespace lamina::coverage
