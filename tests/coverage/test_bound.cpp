// The reported maximum memory of a layer is satisfied by solids on edges of voxels, by noise and by real parts.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <random>

#include "stages/coverage/coverage.h"
#include "stages/load/load.h"
#include "tests/coverage/oracle.h"
#include "tests/load/files.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

struct BoundSums {
  std::uint64_t layers = 0;
  double facets = 0, reported_facets = 0, runs = 0, reported_runs = 0, bytes = 0, reported_bytes = 0;
};

void expect_layer_within(const coverage::Coverage& coverage, const Layer& layer, std::uint32_t levels, BoundSums& sums) {
  coverage::CoverageScratch scratch;  // of this layer alone
  scratch.counts_held = true;
  Levels image;
  const coverage::CoverageReport report = coverage.layer(layer, scratch, image);
  const coverage::LayerBound bound = coverage.bound(layer);
  SCOPED_TRACE(testing::Message() << "layer " << layer.index << " of " << layer.thickness << " nm, " << levels << " levels");
  EXPECT_LE(report.facets, bound.facets);
  EXPECT_LE(report.held_voxels, bound.voxels);
  EXPECT_LE(image.level.size(), bound.runs);
  Runs plane;
  for (std::uint32_t minimum = 1; minimum < levels; ++minimum) {
    threshold_levels(image, static_cast<std::uint8_t>(minimum), plane);
    EXPECT_LE(plane.change.size(), bound.edges) << "of level " << minimum << " and more";
  }
  if (report.inspected == 0) {
    EXPECT_LE(report.scratch_bytes, bound.scratch_bytes);
  }
  ++sums.layers;
  sums.facets += report.facets, sums.reported_facets += static_cast<double>(bound.facets);
  sums.runs += static_cast<double>(image.level.size()), sums.reported_runs += static_cast<double>(bound.runs);
  sums.bytes += static_cast<double>(report.scratch_bytes), sums.reported_bytes += static_cast<double>(bound.scratch_bytes);
}

void expect_layers_within(std::span<Mesh> meshes, std::span<const Instance> instances, const PixelGrid& grid, Nm height,
                          Nm thickness, std::uint32_t max_layers, BoundSums& sums) {
  for (const std::uint32_t levels : {2u, 4u, 16u}) {
    auto coverage = coverage::Coverage::build(meshes, instances, grid, FillRule::kNonzero, levels);
    ASSERT_TRUE(coverage.ok()) << coverage.error().message;
    const auto layers = static_cast<std::uint32_t>(height / thickness + 2);
    const std::uint32_t step = std::max(1u, layers / max_layers);
    for (std::uint32_t i = 0; i < layers && !testing::Test::HasFailure(); i += step) {
      expect_layer_within(*coverage, {i, static_cast<Nm>(i) * thickness, thickness}, levels, sums);
    }
  }
}

void expect_within(const Triangles& triangles, const PixelGrid& grid, Nm height, BoundSums& sums) {
  const Instance instance{0, {0, 0, 0}};
  for (const Nm thickness : {10'000, 64'000, 100'000, 250'000}) {
    Mesh mesh = make_mesh(triangles);
    expect_layers_within({&mesh, 1}, {&instance, 1}, grid, height, thickness, 24 / kThinned, sums);
  }
}

const PixelGrid kTenths{{254, 12'000'000}, {254, 10'000'000}};

// Walls on edges of voxels hold those of both sides; faces at heights of layers none.
TEST(LayerBound, HoldsForSolidsOnEdgesOfVoxels) {
  BoundSums sums;
  expect_within(box({1'000'000, 2'000'000, 0}, {9'000'000, 8'000'000, 1'000'000}), kTenths, 1'000'000, sums);
  Triangles comb;
  for (Nm i = 0; i < 40; ++i) {
    const Triangles tooth = box({1'000'000 + i * 200'000, 1'000'000, 0}, {1'100'000 + i * 200'000, 9'000'000, 640'000});
    comb.insert(comb.end(), tooth.begin(), tooth.end());
  }
  expect_within(comb, kTenths, 640'000, sums);
  Triangles points;  // of a tenth of a voxel, around corners of voxels
  for (Nm i = 0; i < 30; ++i) {
    for (Nm k = 0; k < 30; ++k) {
      const Point3 at{1'000'000 + i * 300'000, 1'000'000 + k * 200'000, 0};
      const Triangles one = box({at.x - 5'000, at.y - 5'000, 0}, {at.x + 5'000, at.y + 5'000, 300'000});
      points.insert(points.end(), one.begin(), one.end());
    }
  }
  expect_within(points, kTenths, 300'000, sums);
  EXPECT_GT(sums.layers, 300u / kThinned);
}

TEST(LayerBound, HoldsForNoise) {
  BoundSums sums;
  std::mt19937 random(77);
  for (int turn = 0; turn < 6; ++turn) {
    const Nm reach = turn % 3 == 0 ? 300'000 : turn % 3 == 1 ? 2'000'000 : 6'000'000;
    const Triangles tetrahedra = random_tetrahedra(turn % 2 == 0 ? 6 : 24, [&, from = Point3{2'000'000, 2'000'000, 0}] {
      const auto draw = [&](Nm maximum) { return static_cast<Nm>(random() % static_cast<std::uint32_t>(maximum)); };
      return Point3{from.x + draw(reach), from.y + draw(reach), draw(2'000'000)};
    });
    expect_within(tetrahedra, kTenths, 2'000'000, sums);
  }
  // Thin sheets of small waves, both sides within a layer: shares rise and fall.
  for (const Nm high : {3'000, 40'000, 150'000}) {
    Triangles sheet;
    constexpr Nm kCells = 12, kCell = 190'000;
    std::vector<Nm> height((kCells + 1) * (kCells + 1));
    for (Nm& z : height) z = 60'000 + static_cast<Nm>(random() % static_cast<std::uint32_t>(high));
    const auto corner = [&](Nm i, Nm k, Nm lift) {
      return Point3{1'000'000 + i * kCell, 1'000'000 + k * kCell,
                    height[static_cast<std::size_t>(k * (kCells + 1) + i)] + lift};
    };
    for (Nm i = 0; i < kCells; ++i) {
      for (Nm k = 0; k < kCells; ++k) {
        for (const Nm lift : {0, 25'000}) {
          Triangle one{corner(i, k, lift), corner(i + 1, k, lift), corner(i + 1, k + 1, lift)};
          Triangle two{corner(i, k, lift), corner(i + 1, k + 1, lift), corner(i, k + 1, lift)};
          if (lift == 0) std::swap(one.b, one.c), std::swap(two.b, two.c);
          sheet.push_back(one), sheet.push_back(two);
        }
      }
      const auto wall = [&](Point3 a, Point3 b) {
        const Point3 c{b.x, b.y, b.z + 25'000}, d{a.x, a.y, a.z + 25'000};
        sheet.push_back({a, b, c}), sheet.push_back({a, c, d});
      };
      wall(corner(i, 0, 0), corner(i + 1, 0, 0));
      wall(corner(i + 1, kCells, 0), corner(i, kCells, 0));
      wall(corner(0, i + 1, 0), corner(0, i, 0));
      wall(corner(kCells, i, 0), corner(kCells, i + 1, 0));
    }
    expect_within(sheet, kTenths, 300'000, sums);
    expect_within(sheet, {{1200, 12'000'000}, {600, 10'000'000}}, 300'000, sums);
  }
}

TEST(LayerBound, HoldsForRealPartsAndIsNear) {
  BoundSums sums;
  const char* folder = std::getenv("LAMINA_MODELS");
  for (const auto& file : part_files(folder != nullptr ? folder : LAMINA_TEST_DIR "/corpus")) {
    if (std::filesystem::file_size(file) > 4'000'000 || file.string().find("broken") != std::string::npos) continue;
    for (const std::int64_t dpi : {150, 400}) {
      auto part = load::load(file.string(), {});
      if (!part || !std::ranges::all_of(part->meshes, &Mesh::closed)) continue;
      const Point3 low = part->bounds.lo;
      for (Instance& instance : part->instances) {
        const auto move = [](Nm value, std::int64_t by) { return static_cast<Nm>(value + by); };
        instance.offset = {move(instance.offset.x, 1'234'567 - std::int64_t{low.x}),
                           move(instance.offset.y, 2'345'678 - std::int64_t{low.y}),
                           move(instance.offset.z, -std::int64_t{low.z})};
      }
      const PixelGrid grid{{dpi, part->bounds.width() + 4'000'000}, {dpi, part->bounds.depth() + 4'000'000}};
      if (grid.columns() > 4000 || grid.rows() > 4000) continue;
      SCOPED_TRACE(file.string());
      expect_layers_within(part->meshes, part->instances, grid, static_cast<Nm>(part->bounds.height()),
                           dpi == 150 ? 300'000 : 70'000, 12 / kThinned, sums);
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(sums.layers, 300u / kThinned);
  if (kThinned == 1) {  // how near, over all of the layers
    EXPECT_LT(sums.reported_facets, 1.2 * sums.facets);
    EXPECT_LT(sums.reported_runs, 12 * sums.runs);  // 3 where facets are some voxels large
    EXPECT_LT(sums.reported_bytes, 5 * sums.bytes);
  }
  std::cout << sums.layers << " layers: facets reported " << sums.reported_facets / sums.facets << " times, runs "
            << sums.reported_runs / sums.runs << ", scratch " << sums.reported_bytes / sums.bytes << '\n';
}

TEST(LayerBound, ManyCopiesHoldTheFacetsOfThoseThatOneBandMeets) {
  Triangles part;
  add_tetrahedron(part, {0, 0, 0}, {900'000, 0, 0}, {0, 900'000, 0}, {0, 0, 500'000});
  Mesh mesh = make_mesh(part);
  std::vector<Instance> row, column;
  for (Nm i = 0; i < 50; ++i) {
    row.push_back({0, {i * 1'000'000, 500'000, 0}});
    column.push_back({0, {500'000, i * 1'000'000, 0}});
  }
  const PixelGrid grid{{300, 51'000'000}, {300, 51'000'000}};
  const Layer layer{0, 0, 100'000};
  const auto of_row = coverage::Coverage::build({&mesh, 1}, row, grid, FillRule::kNonzero, 4);
  const auto of_column = coverage::Coverage::build({&mesh, 1}, column, grid, FillRule::kNonzero, 4);
  ASSERT_TRUE(of_row.ok() && of_column.ok());
  coverage::CoverageScratch scratch;
  Levels image;
  EXPECT_EQ(of_column->layer(layer, scratch, image).facets, 150u);  // three of each reach above the bottom
  EXPECT_LE(scratch.facets.size(), 16u);
  EXPECT_LT(of_column->bound(layer).scratch_bytes + 150 * sizeof(coverage::SlabFacet), of_row->bound(layer).scratch_bytes);
  EXPECT_LE(scratch.bytes(), of_column->bound(layer).scratch_bytes);
}

}  // namespace
}  // namespace lamina::test
