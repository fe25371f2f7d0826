// tests/formats/test_voxels.cpp: boxes of voxels in other programs' formats, and their surface as a closed mesh.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>
#include <set>

#include "stages/formats/voxels/image.h"
#include "stages/formats/voxels/surface_stl.h"
#include "tests/commands/program.h"
#include "tests/pores/boxes.h"

namespace lamina::formats::voxels {
namespace {

using pores::testing::stack_of;
using pores::testing::Voxels;
using Corner = std::array<float, 3>;

std::string written(const std::string& path, const auto& write) {
  auto file = File::open(path, {.durable = Durable::kNo});
  EXPECT_TRUE(file.ok());
  EXPECT_TRUE(write(*file).ok());
  EXPECT_TRUE(file->finish().ok());
  return test::read_text(path);
}

struct Surface {
  std::vector<std::array<Corner, 3>> facets;
  SurfaceCounts counts;

  double volume() const {  // mm3
    double six = 0;
    for (const auto& f : facets) {
      const auto at = [&](int c, int i) { return static_cast<double>(f[c][i]); };
      six += at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) + at(0, 1) * (at(1, 2) * at(2, 0) - at(1, 0) * at(2, 2)) +
             at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
    }
    return six / 6;
  }
  /// Directed edges that are not met by exactly one facet each way.
  std::size_t bad_edges() const {
    std::map<std::pair<Corner, Corner>, int> met;
    for (const auto& f : facets)
      for (int i = 0; i < 3; ++i) ++met[{f[i], f[(i + 1) % 3]}];
    std::size_t bad = 0;
    for (const auto& [edge, times] : met) {
      const auto back = met.find({edge.second, edge.first});
      bad += times != 1 || back == met.end() || back->second != 1 || edge.first == edge.second;
    }
    return bad;
  }
};

Surface surface_of(const VoxelView& box, VoxelPhase side) {
  test::Directory folder;
  Surface surface;
  const std::string bytes = written(folder / "a.stl", [&](File& file) {
    const auto counts = write_surface(file, box, side, "1.2.3");
    if (counts) surface.counts = *counts;
    return counts;
  });
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, 4);
  EXPECT_EQ(bytes.size(), 84 + std::size_t{50} * count);
  EXPECT_EQ(count, surface.counts.facets);
  surface.facets.resize(count);
  for (std::size_t i = 0; i < count; ++i) std::memcpy(&surface.facets[i], bytes.data() + 84 + 50 * i + 12, 36);
  return surface;
}

constexpr std::array<Nm, 3> kEdges{10'000, 12'000, 25'000};
constexpr double kVoxel = 0.010 * 0.012 * 0.025;  // mm3

TEST(VoxelSurface, OfOneVoxelIsTwelveFacetsAroundIt) {
  const Surface one = surface_of(stack_of(Voxels(1, 1, 1, 1), {}, kEdges), VoxelPhase::kSolid);
  EXPECT_EQ(one.facets.size(), 12u);
  EXPECT_EQ(one.bad_edges(), 0u);
  EXPECT_NEAR(one.volume() / kVoxel, 1, 1e-6);
}

// All 256 ways in which eight voxels around a corner can be set: every edge, however voxels meet there.
TEST(VoxelSurface, IsClosedAndHasTheVolumeOfTheVoxelsHoweverEightMeet) {
  for (unsigned pattern = 1; pattern < 256; ++pattern) {
    const Voxels box = Voxels(2, 2, 2).fill([&](auto x, auto y, auto z) { return pattern >> (x + 2 * y + 4 * z) & 1; });
    const Surface surface = surface_of(stack_of(box, {}, kEdges), VoxelPhase::kSolid);
    EXPECT_EQ(surface.bad_edges(), 0u) << pattern;
    EXPECT_NEAR(surface.volume() / kVoxel, std::popcount(pattern), 1e-5) << pattern;
  }
}

TEST(VoxelSurface, OfNoiseIsClosedForSolidAndVoidWhichFillTheBoxTogether) {
  for (std::uint32_t seed = 1; seed <= 16; ++seed) {
    const Voxels box = pores::testing::random_box(seed, 8);
    if (std::ranges::count(box.solid, box.solid.front()) == static_cast<std::ptrdiff_t>(box.solid.size())) continue;
    const VoxelStack stack = stack_of(box, {true, false, true}, kEdges);
    const Surface solid = surface_of(stack, VoxelPhase::kSolid), empty = surface_of(stack, VoxelPhase::kVoid);
    EXPECT_EQ(solid.bad_edges(), 0u) << seed;
    EXPECT_EQ(empty.bad_edges(), 0u) << seed;
    const double set = std::accumulate(box.solid.begin(), box.solid.end(), 0.0), all = static_cast<double>(box.solid.size());
    EXPECT_NEAR(solid.volume() / kVoxel, set, 1e-4) << seed;
    EXPECT_NEAR(empty.volume() / kVoxel, all - set, 1e-4) << seed;
  }
}

TEST(VoxelSurface, PartsTwoVoxelsThatMeetInAnEdgeAlone) {
  const Voxels pair = Voxels(2, 2, 1).fill([](auto x, auto y, auto) { return x == y; });
  const Surface surface = surface_of(stack_of(pair, {}, kEdges), VoxelPhase::kSolid);
  EXPECT_EQ(surface.counts.parted_edges, 1u);
  std::set<Corner> corners;
  for (const auto& facet : surface.facets) corners.insert(facet.begin(), facet.end());
  // 14 corners of two blocks that share an edge, its middle in two places, and the middles of the four faces that bend.
  EXPECT_EQ(corners.size(), 14u + 2 + 4);
}

TEST(VoxelImages, SayTheirSizeAndHoldAByteAVoxelWithXFastest) {
  const Voxels box = Voxels(3, 2, 2).fill([](auto x, auto y, auto z) { return x + 2 * y + z == 2; });
  const VoxelStack stack = stack_of(box, {}, kEdges);
  test::Directory folder;
  const auto image = [&](const std::string& name, VoxelPhase side) {
    return written(folder / name, [&](File& file) { return write_image(file, stack, side, *image_kind(name), "1.2.3"); });
  };
  const std::string voxels(box.solid.begin(), box.solid.end());
  const std::string nrrd = image("a.NRRD", VoxelPhase::kSolid), mha = image("a.mha", VoxelPhase::kSolid),
                    vti = image("a.vti", VoxelPhase::kSolid);
  EXPECT_TRUE(nrrd.starts_with("NRRD0005\n# written by lamina 1.2.3\n"));
  EXPECT_NE(nrrd.find("\nsizes: 3 2 2\nspace directions: (0.01,0,0) (0,0.012,0) (0,0,0.025)\n"), std::string::npos) << nrrd;
  EXPECT_NE(nrrd.find("\nspace origin: (0.005,0.006,0.0125)\nencoding: raw\n\n"), std::string::npos) << nrrd;
  EXPECT_EQ(nrrd.substr(nrrd.find("\n\n") + 2), voxels);
  EXPECT_NE(mha.find("\nElementSpacing = 0.01 0.012 0.025\nDimSize = 3 2 2\nElementType = MET_UCHAR\n"), std::string::npos);
  EXPECT_EQ(mha.substr(mha.find("LOCAL\n") + 6), voxels);
  EXPECT_NE(vti.find("WholeExtent=\"0 3 0 2 0 2\" Origin=\"0 0 0\" Spacing=\"0.01 0.012 0.025\""), std::string::npos);
  EXPECT_EQ(vti.substr(vti.find("\n_") + 2, 8 + voxels.size()), std::string("\x0c\0\0\0\0\0\0\0", 8) + voxels);
  std::string others = voxels;
  for (char& one : others) one = static_cast<char>(1 - one);
  const std::string empty = image("b.nrrd", VoxelPhase::kVoid);
  EXPECT_EQ(empty.substr(empty.find("\n\n") + 2), others);
  EXPECT_FALSE(image_kind("a.png").has_value());
}

TEST(VoxelSurface, OfNothingIsAnErrorAndNoFile) {
  test::Directory folder;
  auto file = File::open(folder / "a.stl");
  ASSERT_TRUE(file.ok());
  const auto counts = write_surface(*file, stack_of(Voxels(2, 2, 2), {}, kEdges), VoxelPhase::kSolid, "1.2.3");
  ASSERT_FALSE(counts.ok());
  EXPECT_EQ(counts.error().fault, Fault::kInput);
  EXPECT_EQ(file->size(), 0u);
}

}  // namespace
}  // namespace lamina::formats::voxels
