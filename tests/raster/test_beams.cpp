// Clusters found by rays and by the tables of runs against their boxes, compared one by one.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "stages/geometry/interval_table.h"
#include "stages/raster/beams.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

using raster::ClusterVisits;

struct Sought {
  std::int64_t plane, low, high;
  bool met_by(const Box& box, const Point3& at) const {
    return std::int64_t{box.lo.z} + at.z <= plane && std::int64_t{box.hi.z} + at.z > plane &&
           std::int64_t{box.lo.y} + at.y <= high && std::int64_t{box.hi.y} + at.y >= low;
  }
};

/// How often each cluster of an instance was found.
std::map<std::pair<std::uint32_t, std::uint32_t>, int> counted(const ClusterVisits& visits) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> count;
  for (const raster::ClusterVisit& visit : visits) ++count[{visit.instance, visit.cluster}];
  return count;
}

TEST(HeightRuns, FindEveryClusterWhoseBoxThePlaneMeetsBetweenTwoRowsOnce) {
  std::mt19937_64 random(3);
  const auto within = [&](std::int64_t from, std::int64_t to) {
    return from + static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(to - from + 1));
  };
  std::uint64_t found = 0, in_vain = 0;
  for (const std::int64_t reach : {3ll, 60'000ll, 70'000ll, 48'000'000ll, 2'147'483'647ll}) {
    for (const std::size_t clusters : {std::size_t{1}, std::size_t{15}, std::size_t{256}, std::size_t{257}, std::size_t{700}}) {
      Buffer<Box> boxes;
      for (std::size_t i = 0; i < clusters; ++i) {
        const auto corner = [&] {
          return Point3{0, static_cast<Nm>(within(-reach, reach)), static_cast<Nm>(within(-reach, reach))};
        };
        Box box;
        box.add(corner());
        box.add(i % 7 == 0 ? box.lo : corner());  // some are flat: no plane cuts them
        boxes.push_back(box);
      }
      const raster::HeightRuns runs(boxes);
      for (int i = 0; i < 60; ++i) {
        Sought sought{within(-reach, reach), within(-reach, reach), 0};
        if (i % 3 == 0) sought.plane = boxes[random() % clusters].lo.z;
        if (i % 3 == 1) sought.plane = boxes[random() % clusters].hi.z - i % 2;
        sought.high = i % 2 == 0 ? sought.low : within(sought.low, 2 * reach);
        ClusterVisits visits;
        for (std::uint32_t run = 0; run < runs.count(); ++run) {
          runs.find_clusters(run, sought.plane, sought.low, sought.high, 5, visits);
        }
        const auto count = counted(visits);
        for (std::uint32_t c = 0; c < clusters; ++c) {
          const bool met = sought.met_by(boxes[c], {0, 0, 0});
          const auto times = count.contains({5, c}) ? count.at({5, c}) : 0;
          ASSERT_TRUE(times == 1 || (times == 0 && !met)) << "cluster " << c << " of " << clusters << " within " << reach;
          EXPECT_TRUE(times == 0 || (boxes[c].lo.z <= sought.plane && boxes[c].hi.z > sought.plane));
          found += met ? 1 : 0;
          in_vain += times > 0 && !met ? 1 : 0;
          const bool exact = reach <= 30'000;  // steps of 1 nm
          EXPECT_TRUE(!exact || (times == 1) == met);
        }
      }
    }
  }
  EXPECT_GT(found, 10'000u);
  EXPECT_LT(in_vain * 1000, found);
}

TEST(Beams, FindEveryClusterThatContoursFindInTheirRowsOnce) {
  const PixelGrid grid{{600, 100'000'000}, {300, 90'000'000}};
  const raster::PixelSampling sampling(grid);
  std::uint64_t found = 0;
  for (unsigned seed = 0; seed < 6; ++seed) {
    std::mt19937 random(seed);
    const auto pick = [&] {
      return Point3{static_cast<Nm>(random() % 30'000'000), static_cast<Nm>(random() % 20'000'000),
                    static_cast<Nm>(random() % (seed % 2 == 0 ? 9'000'000 : 40'000))};
    };
    std::vector<raster::ClusteredMesh> meshes;
    for (const int solids : {3, 1500}) {
      Mesh mesh = make_mesh(random_tetrahedra(solids, pick));
      meshes.push_back(raster::make_clusters({&mesh, 1}).front());
    }
    std::vector<raster::PlacedMesh> placed;
    for (std::uint32_t i = 0; i < 1 + seed % 4; ++i) {  // one of each, or copies of one
      placed.push_back({&meshes[i % 2], {static_cast<Nm>(random() % 60'000'000), static_cast<Nm>(random() % 60'000'000), 0}});
    }
    const std::uint32_t band = std::uint32_t{1} << (2 * seed);
    auto beams = raster::BeamIndex::build(placed, grid, band);
    ASSERT_TRUE(beams.ok());
    for (int i = 0; i < 100; ++i) {
      const auto plane = static_cast<Nm>(random() % 9'000'000);
      const std::uint32_t first = static_cast<std::uint32_t>(random()) % grid.rows();
      const std::uint32_t last = std::min(grid.rows(), first + 1 + static_cast<std::uint32_t>(random()) % band);
      const Sought sought{plane, sampling.y.centre(first), sampling.y.centre(last - 1)};
      ClusterVisits by_rays, by_height;
      beams->find_clusters(sampling, plane, first, last, by_rays);
      for (std::uint32_t p = 0; p < placed.size(); ++p) {
        heights_of(placed[p].mesh->bounds).find(plane, plane, [&](std::uint32_t c) { by_height.push_back({c, p}); });
      }
      const auto rays = counted(by_rays);
      for (const auto& [cluster, times] : rays) EXPECT_EQ(times, 1);
      for (const auto& [cluster, times] : counted(by_height)) {
        const raster::PlacedMesh& one = placed[cluster.first];
        if (!sought.met_by(one.mesh->bounds[cluster.second], one.offset)) continue;
        ++found;
        ASSERT_TRUE(rays.contains(cluster)) << "seed " << seed << ", plane " << plane << ", rows " << first << " to " << last;
      }
    }
  }
  EXPECT_GT(found, 1000u);
}

}  // namespace
}  // namespace lamina::test
