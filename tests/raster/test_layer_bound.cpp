// What a layer is said to need at most against what it has and takes.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

#include "stages/load/load.h"
#include "stages/raster/layer_bound.h"
#include "stages/raster/raster.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

using raster::CrossingSums;
using raster::LayerBound;

/// Random heights, and every kind of corner's height with its neighbours.
std::vector<Nm> heights_of(const Triangles& triangles, Nm top, std::mt19937& random) {
  std::vector<Nm> heights;
  for (int i = 0; i < 8; ++i) {
    heights.push_back(static_cast<Nm>(random() % static_cast<unsigned>(top)));
    const Triangle& t = triangles[random() % triangles.size()];
    for (Nm z : {t.a.z, t.b.z, t.c.z}) heights.insert(heights.end(), {z - 1, z, z + 1});
  }
  return heights;
}

TEST(LayerBound, IsNeverBelowWhatRandomSolidsHave) {
  std::uint64_t crossings = 0;
  for (unsigned seed = 0; seed < 24; ++seed) {
    std::mt19937 random(seed);
    const Nm scale = std::array<Nm, 4>{30'000, 800'000, 9'000'000, 60'000'000}[seed % 4];
    const Nm size = seed % 3 == 0 ? scale : scale / 20 + 1;  // of a solid; the others are small and many
    Triangles triangles;
    for (int i = 0; i < (seed % 3 == 0 ? 12 : 150); ++i) {
      const auto any = [&](Nm maximum) { return static_cast<Nm>(random() % static_cast<unsigned>(maximum)); };
      const Point3 at{any(scale), any(scale), any(scale)};
      const auto pick = [&] { return Point3{at.x + any(size), at.y + any(seed % 5 == 0 ? 50 : size), at.z + any(size)}; };
      for (const Triangle& t : random_tetrahedra(1, pick)) triangles.push_back(t);
    }
    const std::vector<Instance> instances{{0, {0, 0, 0}}, {0, {1'234, 777'777, 0}}, {0, {99, 3, 500'001}}};
    const PixelGrid grid{{1200, 130'000'000}, {static_cast<std::int64_t>(100 + random() % 2400), 130'000'000}};
    Mesh mesh = make_mesh(triangles), again = mesh;
    const raster::ClusteredMesh clusters = raster::make_clusters({&again, 1}).front();
    std::vector<raster::PlacedMesh> placed;
    for (const Instance& instance : instances) placed.push_back({&clusters, instance.offset});
    const LayerBound bound(placed, {&clusters, 1}, {raster::sum_crossings(clusters).table()}, grid);
    auto rasterizer = raster::Rasterizer::build({&mesh, 1}, instances, grid, FillRule::kNonzero, false, true);
    ASSERT_TRUE(rasterizer.ok());
    for (const Nm plane : heights_of(triangles, scale + size, random)) {
      raster::LayerScratch scratch;
      Runs runs;
      const raster::LayerReport report = rasterizer->layer(raster::Engine::kContours, plane, scratch, runs);
      const LayerBound::CrossingCount maximum = bound.at(plane);
      ASSERT_LE(report.segments, maximum.segments) << "seed " << seed << " at " << plane << " nm";
      ASSERT_LE(report.crossings, maximum.crossings) << "seed " << seed << " at " << plane << " nm";
      ASSERT_LE(scratch.visits.size(), maximum.clusters) << "seed " << seed << " at " << plane << " nm";
      ASSERT_LE(maximum.crossings, bound.max_crossings());
      ASSERT_LE(report.scratch_bytes + bytes_held(runs.change) + bytes_held(runs.row_offset),
                rasterizer->layer_bytes_bound(plane));
      crossings += report.crossings;
    }
  }
  EXPECT_GT(crossings, 0u);
}

TEST(CrossingSums, OfPartsOfAMeshBoundTheWholeInAnyOrder) {
  std::mt19937 random(17);
  const auto pick = [&] {
    const auto any = [&](unsigned maximum) { return static_cast<Nm>(random() % maximum); };
    return Point3{any(50'000'000), any(50'000'000), any(1'000'000) + 1'000'000 * any(150) - 40'000'000};
  };
  Triangles triangles = random_tetrahedra(900, pick);
  Mesh mesh = make_mesh(triangles);
  const raster::ClusteredMesh clusters = raster::make_clusters({&mesh, 1}).front();
  const CrossingSums none_yet(mesh.bounds.lo.z, mesh.bounds.hi.z);
  std::vector<CrossingSums> parts(7, none_yet);
  CrossingSums whole = none_yet, all = none_yet;
  for (std::uint32_t c = 0; c < clusters.cluster_count(); ++c) {
    whole.add(clusters, c);
    parts[std::size_t{c} * c % 7].add(clusters, clusters.cluster_count() - 1 - c);
  }
  for (const CrossingSums& part : parts) all.merge(part);
  const CrossingSums::Table merged = all.table(), direct = whole.table(), threads = raster::sum_crossings(clusters).table();
  ASSERT_EQ(merged.slab.size(), direct.slab.size());
  for (std::size_t i = 0; i < direct.slab.size(); ++i) {
    ASSERT_EQ(merged.slab[i].depth, direct.slab[i].depth) << i;
    ASSERT_EQ(merged.slab[i].segments, direct.slab[i].segments) << i;
    ASSERT_EQ(merged.slab[i].clusters, direct.slab[i].clusters) << i;
  }
  double claimed = 0, had = 0;
  for (int i = 0; i < 1000; ++i) {
    const std::int64_t plane = -45'000'000 + 200'003 * std::int64_t{i};
    std::int64_t cut = 0;
    double depth = 0;
    for (const Triangle& t : triangles) {
      const Point3 corner[3] = {t.a, t.b, t.c};
      double low = 1e18, high = -1e18;
      for (int k = 0; k < 3; ++k) {
        const Point3 &from = corner[k], &to = corner[(k + 1) % 3];
        if ((from.z > plane) == (to.z > plane)) continue;
        const double y =
            from.y + (static_cast<double>(plane) - from.z) / (static_cast<double>(to.z) - from.z) * (to.y - from.y);
        low = std::min(low, y);
        high = std::max(high, y);
      }
      cut += low <= high ? 1 : 0;
      depth += low <= high ? high - low : 0;
    }
    const CrossingSums::Slab none, *at = merged.at(plane), *of = threads.at(plane);
    ASSERT_GE((at != nullptr ? at : &none)->segments, cut) << plane;
    ASSERT_GE((at != nullptr ? at : &none)->depth, depth - 1) << plane;
    ASSERT_GE((of != nullptr ? of : &none)->depth, depth - 1) << plane;
    claimed += at != nullptr ? at->depth : 0;
    had += depth;
  }
  EXPECT_LT(claimed, 1.2 * had);
}

/// A torus of rings x sides x 2 facets, standing askew.
Triangles torus(int rings, int sides) {
  const auto at = [&](int ring, int side) {
    const double u = 2 * std::numbers::pi * ring / rings, v = 2 * std::numbers::pi * side / sides;
    const double r = 9e6 + 3e6 * std::cos(v), x = r * std::cos(u), y = r * std::sin(u), z = 3e6 * std::sin(v);
    return Point3{static_cast<Nm>(14e6 + x), static_cast<Nm>(14e6 + 0.8 * y - 0.6 * z),
                  static_cast<Nm>(11e6 + 0.6 * y + 0.8 * z)};
  };
  Triangles out;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sides; ++j) {
      const Point3 a = at(i, j), b = at((i + 1) % rings, j), c = at((i + 1) % rings, (j + 1) % sides),
                   d = at(i, (j + 1) % sides);
      out.insert(out.end(), {{a, b, c}, {a, c, d}});
    }
  }
  return out;
}

/// A layer writes its segments, crossings and changes once, and three numbers a row or fewer.
void expect_true_within_two(Mesh mesh, std::int64_t dpi, const std::string& name) {
  const Point3 lo = mesh.bounds.lo;
  const Instance instance{0, {1'000'000 - lo.x, 1'000'000 - lo.y, -lo.z}};
  const PixelGrid grid{{dpi, mesh.bounds.width() + 2'000'000}, {dpi, mesh.bounds.depth() + 2'000'000}};
  const auto top = static_cast<Nm>(mesh.bounds.height());
  auto rasterizer = raster::Rasterizer::build({&mesh, 1}, {&instance, 1}, grid, FillRule::kNonzero, true, true);
  ASSERT_TRUE(rasterizer.ok());
  for (const raster::Engine engine : {raster::Engine::kRays, raster::Engine::kContours}) {
    std::uint64_t claimed = 0, taken = 0, maximum = 0;
    raster::LayerScratch kept;  // from layer to layer, as a thread does
    Runs kept_runs;
    for (Nm plane = 25'000; plane < top; plane += top / 40) {
      raster::LayerScratch scratch;
      Runs runs;
      const raster::LayerReport report = rasterizer->layer(engine, plane, scratch, runs);
      const std::uint64_t bound = rasterizer->layer_bytes_bound(plane);
      EXPECT_GE(bound, report.scratch_bytes + bytes_held(runs.change) + bytes_held(runs.row_offset)) << name << " at " << plane;
      maximum = std::max(maximum, bound);
      const std::uint64_t holds = rasterizer->layer(engine, plane, kept, kept_runs).scratch_bytes;
      EXPECT_GE(maximum, holds + bytes_held(kept_runs.change) + bytes_held(kept_runs.row_offset)) << name << " up to " << plane;
      claimed += bound;
      taken += scratch.visits.size() * sizeof(raster::ClusterVisit) + report.segments * raster::Segments::kBytes +
               4 * (report.crossings + runs.change.size() + 2 * runs.row_offset.size());
    }
    EXPECT_LE(claimed, 2 * taken) << name;
  }
}

TEST(Tents, AreTheSameBitsWithEveryInstructionSetAndReturnToNothing) {
  std::mt19937 random(23);
  const auto any = [&](std::uint32_t of) { return static_cast<Nm>(random() % of) - static_cast<Nm>(of / 2); };
  std::vector<Point3> vertices(5000);
  for (std::uint32_t i = 0; i < 300; ++i) {
    const std::uint32_t shift = 15 + i % 4;
    const Nm low = any(1 << 22);
    for (Point3& vertex : vertices) {
      const std::uint32_t kind = random() % 4;
      vertex = {any(UINT32_MAX), i % 5 == 0 ? any(UINT32_MAX) : any(1 << 20),
                kind == 0   ? any(1 << 28)
                : kind == 1 ? any(1 << 20)
                            : low};
    }
    IndexedCluster cluster{};
    for (auto& corners : cluster.corner) {
      for (std::uint16_t& corner : corners) corner = static_cast<std::uint16_t>(random() % vertices.size());
    }
    raster::Sides plain_sides, sides;
    raster::Tents plain, tents;
    raster::kernels_for(Isa::kPlain).load_sides(cluster, vertices.data(), plain_sides);
    raster::kernels_for(Isa::kPlain).raise_tents(plain_sides, shift, -(1 << (27 - shift)), plain);
    for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
      EXPECT_EQ(plain_sides.z[1][lane], vertices[cluster.corner[1][lane]].z);
      EXPECT_EQ(plain_sides.y[2][lane], vertices[cluster.corner[2][lane]].y);
      EXPECT_GE(plain.begin[lane], 0);
      EXPECT_LE(plain.end[lane], 1 << (28 - shift));
      // The sum of the depth behind its end.
      const double up = plain.up[lane], down = plain.down[lane];
      EXPECT_EQ(up * (plain.top[lane] - plain.begin[lane]), down * (plain.end[lane] + 1 - plain.fall[lane])) << i;
      EXPECT_EQ(std::ldexp(up, 16), std::floor(std::ldexp(up, 16)));
    }
    for (const Isa isa : {Isa::kAvx2, Isa::kAvx512}) {
      const raster::Kernels& kernels = raster::kernels_for(limited_isa(isa));
      kernels.load_sides(cluster, vertices.data(), sides);
      kernels.raise_tents(sides, shift, -(1 << (27 - shift)), tents);
      ASSERT_EQ(std::memcmp(&sides, &plain_sides, sizeof sides), 0) << i;
      ASSERT_EQ(std::memcmp(&tents, &plain, sizeof tents), 0) << i;
    }
  }
}

TEST(CrossingSums, WhatEndsBelowAGapIsNotCountedAboveIt) {
  constexpr Nm kDeep = 20'000'000, kTop = 10'000'000;
  for (Nm gap = 500; gap < 20'000; gap += 500) {
    Triangles triangles = box({0, 0, 0}, {kDeep, kDeep, 2'000'000});
    for (const Triangle& t : box({0, 0, 2'000'000 + gap}, {kDeep, kDeep, kTop})) triangles.push_back(t);
    Mesh mesh = make_mesh(triangles);
    const raster::ClusteredMesh clusters = raster::make_clusters({&mesh, 1}).front();
    CrossingSums sums(0, kTop);
    for (std::uint32_t c = 0; c < clusters.cluster_count(); ++c) sums.add(clusters, c);
    const CrossingSums::Table table = sums.table();
    for (const Nm plane : {1'000'000, 2'010'000 + gap, 3'000'000, 6'000'000, kTop - 1}) {  // in slabs of one box
      const CrossingSums::Slab* const slab = table.at(plane);
      ASSERT_NE(slab, nullptr);
      EXPECT_GE(slab->depth, 2.0 * kDeep) << gap << " nm, at " << plane;  // two walls along y
      EXPECT_LE(slab->depth, 2.1 * kDeep) << gap << " nm, at " << plane;
    }
  }
}

TEST(CrossingSums, FewerSlabsHoldNoLessThanAsMuchAndNoMoreThanTheLargestOfThoseJoined) {
  std::mt19937 random(8);
  for (int round = 0; round < 50; ++round) {
    CrossingSums::Table fine{12, static_cast<std::int64_t>(random() % 400) - 200, {}};
    fine.slab.resize(random() % 300);
    for (std::size_t i = fine.slab.size() / 4; i < fine.slab.size() * 3 / 4; ++i) {
      fine.slab[i] = {static_cast<double>(random() % 50), static_cast<std::int64_t>(random() % 9),
                      static_cast<std::int64_t>(random() % 3)};
    }
    CrossingSums::Table few = fine;
    few.fit(2 + random() % 90);
    for (std::size_t i = 0; i < fine.slab.size(); ++i) {
      const CrossingSums::Slab none, *found = few.at((fine.first + static_cast<std::int64_t>(i)) << fine.shift);
      EXPECT_GE((found != nullptr ? *found : none).depth, fine.slab[i].depth);
      EXPECT_GE((found != nullptr ? *found : none).segments, fine.slab[i].segments);
      EXPECT_GE((found != nullptr ? *found : none).clusters, fine.slab[i].clusters);
    }
    for (std::size_t j = 0; j < few.slab.size(); ++j) {
      double depth = 0;
      const std::int64_t begin = (few.first + static_cast<std::int64_t>(j)) << few.shift;
      for (std::int64_t z = begin; z < begin + (std::int64_t{1} << few.shift); z += std::int64_t{1} << fine.shift) {
        if (const CrossingSums::Slab* slab = fine.at(z)) depth = std::max(depth, slab->depth);
      }
      EXPECT_EQ(few.slab[j].depth, depth);
    }
  }
}

TEST(LayerBound, ClaimsNoMoreThanTwiceWhatLayersOfPartsTake) {
  expect_true_within_two(make_mesh(torus(40, 16)), 1200, "a coarse torus");
  expect_true_within_two(make_mesh(torus(400, 120)), 1200, "a fine torus");
  auto crown = load::load(std::string(LAMINA_TEST_DIR) + "/corpus/dental_crown.stl", {});
  ASSERT_TRUE(crown.ok());
  expect_true_within_two(crown->meshes[0], 600, "a crown");
  expect_true_within_two(crown->meshes[0], 2400, "a crown");
}

}  // namespace
}  // namespace lamina::test
