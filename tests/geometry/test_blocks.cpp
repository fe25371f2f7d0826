// tests/geometry/test_blocks.cpp: blocks contain what the list contained, for any list.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/geometry/blocks/block_maker.h"

namespace lamina::test {
namespace {

std::vector<Triangle> in_order(std::vector<Triangle> triangles) {
  std::sort(triangles.begin(), triangles.end(), [](const Triangle& one, const Triangle& other) {
    return std::tie(one.a, one.b, one.c) < std::tie(other.a, other.b, other.c);
  });
  return triangles;
}

/// Facets over the cells of a grid, row by row: neighbours share vertices, two facets a vertex.
std::vector<Triangle> grid_of_facets(std::uint32_t count) {
  constexpr std::uint32_t kCells = 40;
  const auto corner = [](std::uint32_t x, std::uint32_t y) {
    return Point3{static_cast<Nm>(x * 1000), static_cast<Nm>(y * 1000), static_cast<Nm>((x * 7 + y * 13) % 31 * 500)};
  };
  std::vector<Triangle> out;
  for (std::uint32_t cell = 0; out.size() < count; ++cell) {
    const std::uint32_t x = cell % kCells, y = cell / kCells;
    out.push_back({corner(x, y), corner(x + 1, y), corner(x, y + 1)});
    out.push_back({corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)});
  }
  out.resize(count);
  return out;
}

/// Facets none of which shares a vertex with another, from the whole range of coordinates.
std::vector<Triangle> facets_apart(std::uint32_t count) {
  std::mt19937 random(7);
  std::uniform_int_distribution<Nm> anywhere(-INT32_MAX, INT32_MAX);
  const auto corner = [&] { return Point3{anywhere(random), anywhere(random), anywhere(random)}; };
  std::vector<Triangle> out;
  for (std::uint32_t i = 0; i < count; ++i) out.push_back({corner(), corner(), corner()});
  return out;
}

Mesh mesh_of_list(const std::vector<Triangle>& triangles, std::uint32_t repaired_from = UINT32_MAX) {
  Mesh mesh;
  mesh.triangles.assign(triangles.begin(), triangles.end());
  mesh.repaired_from = repaired_from;
  return mesh;
}

std::shared_ptr<MeshBlocks> blocks_of(Mesh& mesh) { return take_blocks({&mesh, 1}).front(); }

/// The triangles of clusters [begin, end), read in both ways; lanes beyond `count` have to be points within the cluster's box.
std::vector<Triangle> triangles_in(const MeshBlocks& blocks, std::uint32_t begin, std::uint32_t end, std::uint32_t count) {
  std::vector<Triangle> all;
  Cluster capacity;
  for (std::uint32_t c = begin; c < end; ++c) {
    Box box;
    for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
      const Triangle t = blocks.cluster(c, capacity).triangle(lane);
      EXPECT_EQ(t, blocks.triangle(c, lane)) << c << " " << lane;
      for (const Point3& corner : {t.a, t.b, t.c}) box.add(corner);
      if (all.size() < count) {
        all.push_back(t);
      } else {
        EXPECT_TRUE(t.a == t.b && t.b == t.c) << c << " " << lane;
      }
    }
    EXPECT_EQ(blocks.bounds()[c].lo, box.lo) << c;
    EXPECT_EQ(blocks.bounds()[c].hi, box.hi) << c;
  }
  return all;
}

void expect_same_triangles(const std::vector<Triangle>& list, std::uint32_t own) {
  SCOPED_TRACE(std::to_string(list.size()) + " triangles, own: " + std::to_string(own));
  Mesh mesh = mesh_of_list(list, own);
  const auto blocks = blocks_of(mesh);
  EXPECT_TRUE(mesh.triangles.empty());
  const auto count = static_cast<std::uint32_t>(list.size());
  own = std::min(own, count);
  EXPECT_EQ(blocks->triangle_count(), count);
  EXPECT_EQ(triangle_count(mesh_of_list(list)), count);
  EXPECT_EQ(blocks->first_cap(), (own + kClusterSize - 1) / kClusterSize);
  const auto middle = list.begin() + own;
  EXPECT_EQ(in_order(triangles_in(*blocks, 0, blocks->first_cap(), own)), in_order({list.begin(), middle}));
  EXPECT_EQ(triangles_in(*blocks, blocks->first_cap(), blocks->cluster_count(), count - own),
            std::vector<Triangle>(middle, list.end()));
}

TEST(Blocks, HoldTheTrianglesOfTheListForEveryLength) {
  for (const std::uint32_t count : {0u, 1u, 2u, 15u, 16u, 17u, 4095u, 4096u, 4097u, 12'345u}) {
    expect_same_triangles(grid_of_facets(count), UINT32_MAX);
    expect_same_triangles(facets_apart(count), UINT32_MAX);
  }
}

TEST(Blocks, KeepWhatRepairAddedInItsOrderInClustersOfItsOwn) {
  for (const std::uint32_t own : {0u, 1u, 16u, 4090u, 4096u, 9000u, 9999u}) {
    expect_same_triangles(grid_of_facets(10'000), own);
    expect_same_triangles(facets_apart(10'000), own);
  }
}

TEST(Blocks, OfRandomMeshesOverFewAndManyVerticesHoldTheSame) {
  std::mt19937 random(3);
  for (const std::uint32_t vertices : {1u, 5u, 1000u, 5000u, 7000u, 12'000u}) {
    std::vector<Point3> vertex = {{0, 0, -1}, {-1, -1, -1}, {INT32_MAX, -INT32_MAX, 0}};
    for (std::uint32_t v = 0; v < vertices; ++v) {  // many equal in two coordinates
      const auto any = [&](std::uint32_t of) { return static_cast<Nm>(random() % of) - static_cast<Nm>(of / 2); };
      vertex.push_back({any(50), any(50) * 65'536, any(1000)});
    }
    std::vector<Triangle> list;
    const auto pick = [&] { return vertex[random() % vertex.size()]; };
    for (int i = 0; i < 9000; ++i) list.push_back({pick(), pick(), pick()});
    expect_same_triangles(list, UINT32_MAX);
  }
}

TEST(Blocks, TakeTwentyBytesATriangleWithTheirBoxesWhereVerticesAreShared) {
  constexpr std::uint32_t kCount = 50'000;
  Mesh mesh = mesh_of_list(grid_of_facets(kCount));
  const auto blocks = blocks_of(mesh);
  EXPECT_LT(blocks->bytes() + blocks->bounds_bytes(), 16 * kCount);
}

TEST(Blocks, FullOfDifferentVerticesTakeNoMoreThanTheList) {
  constexpr std::uint32_t kCount = 3 * kBlockSize;
  Mesh mesh = mesh_of_list(facets_apart(kCount));
  const auto blocks = blocks_of(mesh);
  EXPECT_LE(blocks->bytes(), kCount * sizeof(Triangle) + 1024);
  EXPECT_EQ(blocks->cluster_count(), kCount / kClusterSize);
}

TEST(Blocks, AreTheSameForEveryNumberOfThreads) {
  std::vector<Triangle> list = grid_of_facets(150'000), apart = facets_apart(30'000);
  list.insert(list.end(), apart.begin(), apart.end());
  const auto made = [&](std::size_t threads) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    Mesh mesh = mesh_of_list(list, 170'000);
    return blocks_of(mesh);
  };
  const auto one = made(1), eight = made(8);
  const auto all = [](const MeshBlocks& blocks) { return triangles_in(blocks, 0, blocks.cluster_count(), UINT32_MAX); };
  EXPECT_EQ(all(*one), all(*eight));
  EXPECT_EQ(one->bytes(), eight->bytes());
}

/// Stretches of addresses that the process has.
std::size_t mappings() {
  std::ifstream maps("/proc/self/maps");
  return static_cast<std::size_t>(std::count(std::istreambuf_iterator<char>(maps), {}, '\n'));
}

TEST(Blocks, OfManySmallMeshesAreThoseOfEachAloneAndHaveNoPagesOfTheirOwn) {
  const std::vector<Triangle> list = grid_of_facets(2000), apart = facets_apart(9000);
  std::vector<Mesh> meshes;
  for (std::uint32_t i = 0; i < 1500; ++i) meshes.push_back(mesh_of_list({list.begin(), list.begin() + 1 + i}));
  meshes.push_back(mesh_of_list(apart));
  std::vector<Mesh> again = meshes;
  const std::size_t before = mappings();
  const auto blocks = take_blocks(meshes);
  EXPECT_LT(mappings(), before + 200);
  ASSERT_EQ(blocks.size(), meshes.size());
  for (std::size_t i = 0; i < meshes.size(); i += 25) {
    const auto alone = blocks_of(again[i]);
    const auto all = [](const MeshBlocks& one) { return triangles_in(one, 0, one.cluster_count(), UINT32_MAX); };
    EXPECT_EQ(all(*blocks[i]), all(*alone)) << i;
    EXPECT_EQ(blocks[i]->bytes(), alone->bytes());
    EXPECT_TRUE(meshes[i].triangles.empty());
  }
}

TEST(Blocks, AreOrderedByHeightSoThatAPlaneMeetsFewClusters) {
  constexpr Nm kHigh = 1'000'000;
  std::mt19937 random(5);
  std::vector<Triangle> list = grid_of_facets(kBlockSize);
  for (Triangle& t : list) t.a.z = t.b.z = t.c.z = static_cast<Nm>(random() % kHigh);
  Mesh mesh = mesh_of_list(list);
  const auto blocks = blocks_of(mesh);
  std::int64_t heights = 0;
  for (const Box& box : blocks->bounds()) heights += box.height();
  EXPECT_LT(heights, 4 * kHigh) << "of 256 clusters, each of which is as high as all where there is no order";
}

/// How a cluster names its corners, as bytes; nothing where it is stored as it is read.
std::string named_corners(const MeshBlocks& blocks, std::uint32_t cluster) {
  const MeshBlocks::Indexed indexed = blocks.indexed(cluster);
  if (indexed.cluster == nullptr) return {};
  const std::string steps = std::to_string(indexed.shift) + " " + std::to_string(indexed.step_0) + " ";
  return steps + std::string(reinterpret_cast<const char*>(indexed.cluster), sizeof(IndexedCluster));
}

TEST(Blocks, AreTheSameWithEveryInstructionSet) {
  std::mt19937 random(9);
  std::vector<std::vector<Triangle>> lists;
  for (const std::uint32_t count : {1u, 3u, 17u, 100u, 4095u, 4096u}) {
    lists.push_back(grid_of_facets(count));
    lists.push_back(facets_apart(count));
    std::shuffle(lists.front().begin(), lists.front().end(), random);
    lists.push_back({});
    for (std::uint32_t i = 0; i < count; ++i) {  // a vertex has many facets, and some facets are points
      const auto any = [&] { return Point3{static_cast<Nm>(random() % 9) - 4, INT32_MAX, static_cast<Nm>(random() % 200)}; };
      lists.back().push_back({any(), any(), any()});
    }
  }
  for (const std::vector<Triangle>& list : lists) {
    const auto count = static_cast<std::uint32_t>(list.size());
    const auto made = [&](Isa isa) {
      auto blocks = std::make_unique<MeshBlocks>(count, 0);
      std::make_unique<BlockMaker>(isa)->make(list, *blocks, 0);
      return blocks;
    };
    const auto plain = made(Isa::kPlain);
    const std::vector<Triangle> expected = triangles_in(*plain, 0, plain->cluster_count(), count);
    EXPECT_EQ(in_order(expected), in_order(list));
    for (const Isa isa : {Isa::kAvx2, Isa::kAvx512}) {
      if (isa > widest_isa()) continue;
      SCOPED_TRACE(std::string(isa_name(isa)) + ", " + std::to_string(count) + " triangles");
      const auto wide = made(isa);
      EXPECT_EQ(triangles_in(*wide, 0, wide->cluster_count(), count), expected);
      EXPECT_EQ(wide->bytes(), plain->bytes());
      for (std::uint32_t c = 0; c < plain->cluster_count(); ++c) {
        ASSERT_EQ(named_corners(*wide, c), named_corners(*plain, c)) << c;
      }
    }
  }
}

TEST(Blocks, AreRightRegardlessOfEqualHashes) {
  const std::vector<Triangle> list = grid_of_facets(900);
  for (const unsigned mask : {0u, 1u, 0x3fu}) {
    for (const Isa isa : {Isa::kPlain, Isa::kAvx2, Isa::kAvx512}) {
      if (isa > widest_isa()) continue;
      MeshBlocks blocks(900, 0);
      const auto maker = std::make_unique<BlockMaker>(isa);
      SortedBlock& sorted = maker->sort(list, blocks, 0);
      sorted.hash_corners();
      for (std::uint16_t& hash : sorted.hash) hash = static_cast<std::uint16_t>(hash & mask);
      maker->store(list, blocks, 0);
      EXPECT_EQ(in_order(triangles_in(blocks, 0, blocks.cluster_count(), 900)), in_order(list));
      EXPECT_LT(blocks.bytes(), 900 * 16u) << "each vertex is stored once";
    }
  }
}

/// Facets that share no vertex, near the origin.
std::vector<Triangle> islands(Nm count) {
  std::vector<Triangle> out;
  for (Nm i = 0; i < count; ++i) out.push_back({{i, 0, 3 * i}, {i, 1000, i}, {i, 0, 5 - i}});
  return out;
}

TEST(Blocks, MoveAsAWhole) {
  const Point3 by{5, -7, 1'000'000};
  for (std::vector<Triangle> list : {grid_of_facets(5000), islands(5000)}) {
    Mesh mesh = mesh_of_list(list);
    const auto blocks = blocks_of(mesh);
    blocks->shift(by);
    for (Triangle& t : list) {
      for (Point3* p : {&t.a, &t.b, &t.c}) *p = {p->x + by.x, p->y + by.y, p->z + by.z};
    }
    const auto count = static_cast<std::uint32_t>(list.size());
    EXPECT_EQ(in_order(triangles_in(*blocks, 0, blocks->cluster_count(), count)), in_order(list));
  }
}

TEST(Blocks, PassOverNoFacetThatAPlaneCutsAndOverNearlyAllOthers) {
  std::mt19937 random(11);
  for (const Nm height : {1, 40, 3000, 1'000'000, 20'000'000}) {  // of facets; one in 100 is 20 times as high
    std::vector<Triangle> list;
    Point3 a{-2, 0, 0}, b{-1, 0, 0};
    for (int i = 0; i < 5000; ++i) {
      const auto range = static_cast<unsigned>(i % 100 == 0 ? 20 * height : height);
      const Point3 c{i, i % 7, i / 50 % 64 * height + static_cast<Nm>(random() % range)};
      list.push_back({a, b, c});
      a = std::exchange(b, c);
    }
    Mesh mesh = mesh_of_list(list);
    const auto blocks = blocks_of(mesh);
    for (const Nm lift : {0, 12'345, -777}) {
      blocks->shift({0, 0, lift});
      std::size_t met = 0, cut = 0;
      for (std::uint32_t c = 0; c < blocks->cluster_count(); ++c) {
        const MeshBlocks::Indexed indexed = blocks->indexed(c);
        ASSERT_NE(indexed.cluster, nullptr);
        for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
          const Triangle t = blocks->triangle(c, lane);
          const auto [lowest, highest] = std::minmax({t.a.z, t.b.z, t.c.z});
          const Box& box = blocks->bounds()[c];
          const Nm middle = box.lo.z / 2 + box.hi.z / 2;
          for (const Nm plane : {lowest, lowest - 1, highest - 1, highest, box.lo.z, middle, box.hi.z - 1}) {
            const FacetSteps& steps = indexed.cluster->steps;
            const bool is_met = static_cast<std::uint8_t>(indexed.step_of(plane) - steps.low[lane]) <= steps.span[lane];
            const bool is_cut = lowest <= plane && plane < highest;
            ASSERT_TRUE(is_met || !is_cut) << "plane " << plane << " of a facet from " << lowest << " to " << highest;
            met += plane == middle && is_met ? 1 : 0;
            cut += plane == middle && is_cut ? 1 : 0;
          }
        }
      }
      if (height > 40) {  // a step is more than a nanometre
        EXPECT_LT(static_cast<double>(met), 1.2 * static_cast<double>(cut)) << height;
      }
    }
  }
}

TEST(Blocks, NameEveryVertex) {
  for (const std::vector<Triangle>& list : {grid_of_facets(5000), facets_apart(5000)}) {
    Box expected, detected;
    for (const Triangle& t : list) expected.add(t.a), expected.add(t.b), expected.add(t.c);
    Mesh mesh = mesh_of_list(list);
    mesh.blocks = blocks_of(mesh);
    std::size_t vertices = 0;
    each_vertex(mesh, [&](const Point3& p) { detected.add(p), ++vertices; });
    EXPECT_EQ(detected.lo, expected.lo);
    EXPECT_EQ(detected.hi, expected.hi);
    EXPECT_LE(vertices, 3 * list.size());
  }
}

}  // namespace
}  // namespace lamina::test
