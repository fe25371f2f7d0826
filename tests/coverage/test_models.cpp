// Levels of real parts against the contract, in windows around facets: every file of the folder LAMINA_MODELS names.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <random>

#include "stages/coverage/coverage.h"
#include "stages/load/load.h"
#include "stages/raster/raster.h"
#include "tests/coverage/oracle.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

constexpr int kLayersOfModel = 36 / kThinned;
constexpr int kWindowsOfLayer = 6;
constexpr std::uintmax_t kLargestFile = 4'000'000;  // beyond, most of the time would go into meetings of facets

struct CoveredModel {
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<Triangle> facets;  // where they stand
  PixelGrid grid;
  Nm height = 0;
};

bool load_model(const std::string& path, std::int64_t dpi, CoveredModel& model) {
  auto part = load::load(path, {});
  if (!part) return false;
  const auto move = [](Nm value, std::int64_t by) { return static_cast<Nm>(value + by); };
  const Point3 low = part->bounds.lo;
  for (Instance& instance : part->instances) {
    instance.offset = {move(instance.offset.x, 1'234'567 - std::int64_t{low.x}),
                       move(instance.offset.y, 2'345'678 - std::int64_t{low.y}), move(instance.offset.z, -std::int64_t{low.z})};
    const Point3 by = instance.offset;
    for (Triangle t : part->meshes[instance.mesh].triangles) {
      for (Point3* p : {&t.a, &t.b, &t.c}) *p = {move(p->x, by.x), move(p->y, by.y), move(p->z, by.z)};
      model.facets.push_back(t);
    }
  }
  model.grid = {{dpi, part->bounds.width() + 4'000'000}, {dpi, part->bounds.depth() + 4'000'000}};
  model.height = static_cast<Nm>(part->bounds.height());
  model.meshes = std::move(part->meshes);
  model.instances = std::move(part->instances);
  return std::ranges::all_of(model.meshes, &Mesh::closed);
}

std::uint8_t level_at(const LevelsView& image, std::uint32_t column, std::uint32_t geometry_row) {
  const std::uint32_t r = image.rows() - 1 - geometry_row;
  for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i) {
    if (image.change[2 * i] <= column && column < image.change[2 * i + 1]) return image.level[i];
  }
  return 0;
}

struct ComparedVoxels {
  std::uint64_t voxels = 0, partly = 0, wrong = 0;
};

/// Windows of 2 x 2 voxels around corners of facets of the layer.
void compare_layer(const CoveredModel& model, const Layer& layer, const LevelsView& image, std::uint32_t levels,
                   std::mt19937& random, ComparedVoxels& sum) {
  const std::int64_t top = std::int64_t{layer.bottom} + layer.thickness;
  std::vector<std::uint32_t> below, within;
  for (std::uint32_t i = 0; i < model.facets.size(); ++i) {
    const Triangle& t = model.facets[i];
    if (std::min({t.a.z, t.b.z, t.c.z}) > top) continue;
    below.push_back(i);
    if (std::max({t.a.z, t.b.z, t.c.z}) >= layer.bottom) within.push_back(i);
  }
  for (int w = 0; w < kWindowsOfLayer && !within.empty(); ++w) {
    const Point3 at = model.facets[within[random() % within.size()]].a;
    const auto pixel = [](const PixelAxis& axis, std::int64_t nm) {
      return std::clamp<std::uint32_t>(static_cast<std::uint32_t>(nm * axis.dots / axis.span), 2, axis.count - 3);
    };
    const std::uint32_t i = pixel(model.grid.x, at.x), j = pixel(model.grid.y, at.y);
    const std::uint32_t left = i - static_cast<std::uint32_t>(w % 2);
    const VoxelWindow window{left, left + 2, j, j + 2};
    const std::int64_t front = std::int64_t{j} * model.grid.y.span / model.grid.y.dots;
    const std::int64_t back = std::int64_t{j + 2} * model.grid.y.span / model.grid.y.dots;
    std::vector<Triangle> near;
    for (const std::uint32_t f : below) {
      const Triangle& t = model.facets[f];
      if (std::min({t.a.y, t.b.y, t.c.y}) <= back && std::max({t.a.y, t.b.y, t.c.y}) >= front) near.push_back(t);
    }
    const std::vector<VoxelFacts> facts = oracle_voxels(near, model.grid, layer, window);
    std::size_t next = 0;
    for (std::uint32_t r = window.first; r < window.last; ++r) {
      for (std::uint32_t c = window.left; c < window.right; ++c, ++next) {
        const std::uint8_t level = level_at(image, c, r), expected = oracle_level(facts[next], FillRule::kNonzero, levels);
        ++sum.voxels;
        sum.partly += expected > 0 && expected < levels - 1 ? 1 : 0;
        if (level == expected || sum.wrong++ > 3) continue;
        ADD_FAILURE() << "voxel " << c << ", " << r << " of the layer at " << layer.bottom << " nm has level " << int{level}
                      << ", not " << int{expected};
      }
    }
  }
}

TEST(CoverageModels, RealPartsHaveTheLevelsOfTheContract) {
  const char* folder = std::getenv("LAMINA_MODELS");
  if (folder == nullptr) GTEST_SKIP() << "LAMINA_MODELS is not set: shares of large real parts were NOT compared";
  ComparedVoxels sum;
  int parts = 0;
  for (const auto& file : part_files(folder)) {
    CoveredModel model;
    if (std::filesystem::file_size(file) > kLargestFile) continue;
    if (file.string().find("broken") != std::string::npos || !load_model(file.string(), 300, model)) continue;
    if (model.grid.columns() > 4000 || model.grid.rows() > 4000) continue;
    SCOPED_TRACE(file.string());
    const auto begun = std::chrono::steady_clock::now();
    auto coverage = coverage::Coverage::build(model.meshes, model.instances, model.grid, FillRule::kNonzero, 16);
    ASSERT_TRUE(coverage.ok());
    const std::chrono::duration<double> built = std::chrono::steady_clock::now() - begun;
    coverage::CoverageScratch scratch;
  scratch.counts_held = true;
    Levels image;
    std::mt19937 random(5);
    const Nm thickness = 100'000;
    std::uint64_t held = 0, sampled = 0, inspected = 0, exact = 0;
    for (int i = 0; i < kLayersOfModel; ++i) {
      const auto number = static_cast<std::uint32_t>(std::int64_t{model.height} * i / kLayersOfModel / thickness);
      const Layer layer{number, static_cast<Nm>(number) * thickness, thickness};
      const auto report = coverage->layer(layer, scratch, image);
      held += report.held_voxels, sampled += report.sampled_voxels;
      inspected += report.inspected, exact += report.exact_voxels;
      compare_layer(model, layer, image, 16, random, sum);
    }
    ++parts;
    std::cout << file.filename().string() << ": " << model.facets.size() << " facets, built in " << built.count()
              << " s; voxels with facets " << held << ", inspected " << inspected << ", sampled " << sampled
              << ", by rationals " << exact << '\n';
    EXPECT_EQ(sum.wrong, 0u);
    if (HasFailure()) return;
  }
  EXPECT_GE(parts, 14);
  std::cout << parts << " parts, " << parts * kLayersOfModel << " layers, " << sum.voxels << " voxels compared, " << sum.partly
            << " of them partly full\n";
}

TEST(CoverageModels, SharesOfAllLayersAddUpToTheVolumeOfThePart) {
  const char* folder = std::getenv("LAMINA_MODELS");
  if (folder == nullptr) GTEST_SKIP() << "LAMINA_MODELS is not set: volumes of large real parts were NOT compared";
  for (const char* name : {"dental_crown.stl", "nist_part_feature_open.stl", "stanford_bunny.stl"}) {
    CoveredModel model;
    ASSERT_TRUE(load_model(std::string(folder) + "/" + name, 200, model)) << name;
    double whole = 0, sum = 0;
    for (const Mesh& mesh : model.meshes) whole += mesh.volume_mm3;
    auto coverage = coverage::Coverage::build(model.meshes, model.instances, model.grid, FillRule::kNonzero, 4);
    ASSERT_TRUE(coverage.ok());
    coverage::CoverageScratch scratch;
    Levels image;
    const Nm thickness = 178'000;
    for (std::uint32_t i = 0; static_cast<Nm>(i) * thickness < model.height; ++i) {
      sum += coverage->layer({i, static_cast<Nm>(i) * thickness, thickness}, scratch, image).volume_mm3;
    }
    EXPECT_NEAR(sum, whole, 1e-6 * whole) << name;
    std::cout << name << ": shares add up to the volume within " << std::abs(sum / whole - 1) << '\n';
  }
}

}  // namespace
}  // namespace lamina::test
