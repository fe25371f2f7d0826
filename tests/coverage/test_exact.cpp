// Levels of single voxels from the facets that may meet them, against the volumes of the contract.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "stages/coverage/band/exact.h"
#include "tests/coverage/oracle.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

constexpr std::int64_t kSide = 1000;  // of a voxel, nm
const PixelGrid kVoxels{{25'400, 8'000}, {25'400, 8'000}};

/// How many voxels of the middle of the grid have another level than the oracle's, where doubles are off by a hundredth.
int differing_voxels(const Triangles& all, std::uint32_t levels, std::mt19937& random) {
  const Layer layer{0, 0, kSide};
  const VoxelWindow window{2, 6, 2, 6};
  const auto facts = oracle_voxels(all, kVoxels, layer, window);
  std::vector<coverage::SlabFacet> facets(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) facets[i].facet = all[i], facets[i].suspect = false;
  int differing = 0;
  std::size_t at = 0;
  for (std::int64_t j = window.first; j < window.last; ++j) {
    for (std::int64_t i = window.left; i < window.right; ++i, ++at) {
      const coverage::Voxel voxel{i * kSide, (i + 1) * kSide, j * kSide, (j + 1) * kSide, 0, kSide};
      std::vector<const coverage::SlabFacet*> near_facets;
      for (const coverage::SlabFacet& facet : facets) {
        Box box;
        for (const Point3* p : {&facet.facet.a, &facet.facet.b, &facet.facet.c}) box.add(*p);
        if (box.lo.x <= voxel.x1 && box.hi.x >= voxel.x0 && box.lo.y <= voxel.y1 && box.hi.y >= voxel.y0 &&
            box.lo.z < voxel.z1 && box.hi.z > voxel.z0)
          near_facets.push_back(&facet);
      }
      const double off = (static_cast<double>(random() % 2001) - 1000) * 1e-5;
      const coverage::NearShare near_share{facts[at].share.get_d() + off, 0.01, levels - 1};
      if (coverage::exact_level(voxel, near_facets, near_share) != oracle_level(facts[at], FillRule::kNonzero, levels))
        ++differing;
    }
  }
  return differing;
}

TEST(ExactLevels, NeedTheFacetsNearAVoxelAlone) {
  std::mt19937 random(11);
  int solids = 0;
  for (int turn = 0; turn < 400; ++turn) {
    const auto anywhere = [&] {
      // Often on edges, faces and middles of voxels.
      const auto at = [&](int from, int to) { return (from + static_cast<Nm>(random() % static_cast<unsigned>(to - from))); };
      const Nm step = turn % 3 == 0 ? 1000 : turn % 3 == 1 ? 500 : 1;
      const int scale = 1000 / step;
      return Point3{at(0, 8 * scale) * step, at(0, 8 * scale) * step, at(-2 * scale, 3 * scale) * step};
    };
    const Point3 a = anywhere(), b = anywhere(), c = anywhere(), d = anywhere();
    const auto cross = [&](std::int64_t u, std::int64_t v, std::int64_t w, std::int64_t x) { return u * x - v * w; };
    const std::int64_t ux = b.x - a.x, uy = b.y - a.y, uz = b.z - a.z, vx = c.x - a.x, vy = c.y - a.y, vz = c.z - a.z;
    const std::int64_t volume =
        (d.x - a.x) * cross(uy, uz, vy, vz) + (d.y - a.y) * cross(uz, ux, vz, vx) + (d.z - a.z) * cross(ux, uy, vx, vy);
    if (volume == 0) continue;
    Triangles all;
    add_tetrahedron(all, a, b, c, d);
    if (volume < 0) all = reversed(all);
    ++solids;
    EXPECT_EQ(differing_voxels(all, turn % 2 == 0 ? 4 : 16, random), 0) << "solid " << turn;
  }
  EXPECT_GT(solids, 300);
}

TEST(ExactLevels, DecideTiesOfOnePlaneByWhatIsOnItsSides) {
  std::mt19937 random(3);
  for (const Nm top : {500, 499, 501, 1, 999, 250}) {
    for (const std::uint32_t levels : {2u, 4u, 16u})
      EXPECT_EQ(differing_voxels(box({100, 200, -50}, {7700, 7600, top}), levels, random), 0) << top;
  }
}

}  // namespace
}  // namespace lamina::test
