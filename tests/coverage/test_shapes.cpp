// Levels of solids of few facets against the contract, voxel for voxel.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <iostream>
#include <numbers>
#include <random>

#include "stages/coverage/coverage.h"
#include "stages/raster/raster.h"
#include "tests/coverage/oracle.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

std::uint8_t level_in(const LevelsView& image, std::uint32_t column, std::uint32_t geometry_row) {
  const std::uint32_t r = image.rows() - 1 - geometry_row;
  for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i) {
    if (image.change[2 * i] <= column && column < image.change[2 * i + 1]) return image.level[i];
  }
  return 0;
}

struct Reported {
  std::uint64_t voxels = 0, exact = 0, sampled = 0, partly = 0;
  double volume_mm3 = 0;
};

/// Compares layers with the oracle under all rules and three numbers of levels.
Reported expect_levels(const Triangles& triangles, const PixelGrid& grid, const std::vector<Layer>& layers) {
  Reported reported;
  std::vector<std::vector<VoxelFacts>> facts;
  for (const Layer& layer : layers) facts.push_back(oracle_voxels(triangles, grid, layer, {0, grid.columns(), 0, grid.rows()}));
  for (const FillRule rule : {FillRule::kNonzero, FillRule::kPositive, FillRule::kEvenOdd}) {
    for (const std::uint32_t levels : {2u, 4u, 16u}) {
      Mesh mesh = make_mesh(triangles);
      const Instance instance{0, {0, 0, 0}};
      auto coverage = coverage::Coverage::build({&mesh, 1}, {&instance, 1}, grid, rule, levels);
      EXPECT_TRUE(coverage.ok());
      coverage::CoverageScratch scratch;
      Levels image;
      for (std::size_t l = 0; l < layers.size(); ++l) {
        const Layer& layer = layers[l];
        const auto report = coverage->layer(layer, scratch, image);
        EXPECT_EQ(image.view().rows(), grid.rows());
        std::size_t at = 0, wrong = 0;
        for (std::uint32_t j = 0; j < grid.rows(); ++j) {
          for (std::uint32_t i = 0; i < grid.columns(); ++i, ++at) {
            const std::uint8_t level = level_in(image, i, j), expected = oracle_level(facts[l][at], rule, levels);
            reported.partly += level > 0 && level < levels - 1 ? 1 : 0;
            if (level == expected) continue;
            if (wrong++ < 3) {
              ADD_FAILURE() << "voxel " << i << ", " << j << " of layer at " << layer.bottom << " nm has level " << int{level}
                            << " of " << levels << ", not " << int{expected};
            }
          }
        }
        reported.voxels += at;
        reported.exact += report.exact_voxels;
        reported.sampled += report.sampled_voxels;
        if (rule == FillRule::kNonzero && levels == 2) reported.volume_mm3 += report.volume_mm3;
        if (wrong > 0) return reported;
      }
    }
  }
  return reported;
}

Triangles joined(std::initializer_list<Triangles> all) {
  Triangles out;
  for (const Triangles& one : all) out.insert(out.end(), one.begin(), one.end());
  return out;
}

double volume_of(const Triangles& triangles) {
  double sum = 0;
  for (const Triangle& t : triangles) {
    const double ax = mm(t.a.x), ay = mm(t.a.y), az = mm(t.a.z), bx = mm(t.b.x), by = mm(t.b.y), bz = mm(t.b.z);
    const double cx = mm(t.c.x), cy = mm(t.c.y), cz = mm(t.c.z);
    sum += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
  }
  return sum / 6;
}

/// Turned about two axes, then moved.
Triangles turned(Triangles triangles, double about_z, double about_x, Point3 by) {
  const double c = std::cos(about_z), s = std::sin(about_z), d = std::cos(about_x), t = std::sin(about_x);
  const auto turn = [&](const Point3& p) {
    const double x = c * p.x - s * p.y, y = s * p.x + c * p.y, z = p.z;
    return Point3{static_cast<Nm>(std::llround(x)) + by.x, static_cast<Nm>(std::llround(d * y - t * z)) + by.y,
                  static_cast<Nm>(std::llround(t * y + d * z)) + by.z};
  };
  for (Triangle& one : triangles) one = {turn(one.a), turn(one.b), turn(one.c)};
  return triangles;
}

Triangles ball(Point3 middle, double radius, int around) {
  Triangles out;
  const auto at = [&](int i, int k) {
    const double theta = std::numbers::pi * i / (around / 2), phi = 2 * std::numbers::pi * (k % around) / around;
    const double ring = i == 0 || 2 * i == around ? 0 : radius * std::sin(theta);
    return Point3{middle.x + static_cast<Nm>(std::llround(ring * std::cos(phi))),
                  middle.y + static_cast<Nm>(std::llround(ring * std::sin(phi))),
                  middle.z + static_cast<Nm>(std::llround(radius * std::cos(theta)))};
  };
  for (int i = 0; 2 * i < around; ++i) {
    for (int k = 0; k < around; ++k) {
      if (i > 0) out.push_back({at(i, k), at(i + 1, k), at(i, k + 1)});
      if (2 * (i + 1) < around) out.push_back({at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)});
    }
  }
  return out;
}

const PixelGrid kSmall{{254, 1'600'000}, {508, 700'000}};  // 16 x 14 voxels of 0.1 x 0.05 mm

std::vector<Layer> layers_of(Nm thickness, int count, Nm bottom = 0) {
  std::vector<Layer> layers;
  for (int i = 0; i < count; ++i) layers.push_back({static_cast<std::uint32_t>(i), bottom + i * thickness, thickness});
  return layers;
}

TEST(CoverageShapes, ABoxThatEndsInTheMiddleOfVoxelsIsATieThatGoesUp) {
  const Triangles part = box({150'000, 125'000, 0}, {1'250'000, 575'000, 150'000});
  const Reported reported = expect_levels(part, kSmall, layers_of(100'000, 2));
  EXPECT_GT(reported.exact, 0u);
  EXPECT_NEAR(reported.volume_mm3, 1.1 * 0.45 * 0.15, 1e-9);
}

TEST(CoverageShapes, ABoxOnVoxelEdgesIsWholeVoxels) {
  const Triangles part = box({100'000, 100'000, 0}, {1'200'000, 550'000, 200'000});
  const Reported reported = expect_levels(part, kSmall, layers_of(100'000, 3));
  EXPECT_EQ(reported.partly, 0u);
  EXPECT_NEAR(reported.volume_mm3, 1.1 * 0.45 * 0.2, 1e-9);
}

TEST(CoverageShapes, TiltedBoxesHaveTheLevelsOfTheContract) {
  for (int i = 0; i < 4; ++i) {
    const Triangles part = turned(box({-280'000, -120'000, -150'000}, {280'000, 120'000, 150'000}), 0.3 + 0.7 * i, 0.2 * i,
                                  {800'000, 350'000, 300'000});
    const Reported reported = expect_levels(part, kSmall, layers_of(100'001, 6));
    EXPECT_NEAR(reported.volume_mm3, volume_of(part), 1e-9 * volume_of(part));
    if (HasFailure()) FAIL() << "box " << i;
  }
}

TEST(CoverageShapes, FacetsOverManyVoxelsStepWhereTheirPlanesDo) {
  for (int i = 0; i < 6; ++i) {
    const double about_x = i % 2 == 0 ? 0.06 + 0.1 * i : -0.11 * i;
    const Triangles part =
        turned(box({-560'000, -190'000, -60'000}, {560'000, 190'000, 60'000}), 0.02 * i, about_x, {800'000, 350'000, 200'000});
    std::vector<Triangle> leaning;
    for (const Triangle& t : part) {
      const auto lean = [](const Point3& p) { return Point3{p.x, p.y, p.z + p.x / 11}; };
      leaning.push_back({lean(t.a), lean(t.b), lean(t.c)});
    }
    const Triangles all(leaning.begin(), leaning.end());
    const Reported reported = expect_levels(all, kSmall, layers_of(70'000, 7));
    EXPECT_EQ(reported.exact + reported.sampled, 0u);
    EXPECT_NEAR(reported.volume_mm3, volume_of(all), 1e-9 * volume_of(all));
    if (HasFailure()) FAIL() << "box " << i;
  }
}

/// A vault along y, its ends fans of facets in one plane.
Triangles vault(Point3 corner, double radius, Nm depth, int around) {
  Triangles out;
  const auto at = [&](int k, Nm y) {
    const double phi = std::numbers::pi * k / around;
    return Point3{corner.x + static_cast<Nm>(std::llround(radius * (1 - std::cos(phi)))), corner.y + y,
                  corner.z + (k % around == 0 ? 0 : static_cast<Nm>(std::llround(0.6 * radius * std::sin(phi))))};
  };
  for (int k = 0; k <= around; ++k) {
    const int next = k == around ? 0 : k + 1;
    out.push_back({at(k, 0), at(k, depth), at(next, depth)});
    out.push_back({at(k, 0), at(next, depth), at(next, 0)});
    if (k == 0 || k == around) continue;
    out.push_back({at(0, 0), at(k, 0), at(next, 0)});
    out.push_back({at(0, depth), at(next, depth), at(k, depth)});
  }
  return out;
}

TEST(CoverageShapes, FacetsAlongARowHoldAllColumnsThatTheyReach) {
  for (const Nm y : {125'000, 137'001, 150'000}) {
    const Triangles part = reversed(vault({150'000, y, 30'000}, 610'000, 310'000, 9));
    const Reported reported = expect_levels(part, kSmall, layers_of(100'000, 4));
    EXPECT_NEAR(reported.volume_mm3, volume_of(part), 1e-9 * volume_of(part));
    if (HasFailure()) FAIL() << "at " << y;
  }
}

TEST(CoverageShapes, ABallHasTheLevelsOfTheContract) {
  const Reported reported = expect_levels(ball({800'000, 350'000, 300'000}, 290'000, 24), kSmall, layers_of(100'000, 6));
  EXPECT_GT(reported.partly, 100u);
  const double whole = volume_of(ball({800'000, 350'000, 300'000}, 290'000, 24));
  EXPECT_NEAR(reported.volume_mm3, whole, 1e-9 * whole);
}

TEST(CoverageShapes, ShellsThatOverlapAreSampledAndMerged) {
  const Triangles part =
      joined({box({150'000, 125'000, 0}, {850'000, 475'000, 150'000}),
              turned(box({-300'000, -150'000, -100'000}, {300'000, 150'000, 100'000}), 0.5, 0.3, {900'000, 350'000, 150'000})});
  const Reported reported = expect_levels(part, kSmall, layers_of(100'000, 3));
  EXPECT_GT(reported.sampled, 0u);
}

TEST(CoverageShapes, FacesOnSamplesCountAsTheBitmapCountsThem) {
  const Triangles part = joined({box({106'250, 103'125, 6'250}, {506'250, 303'125, 156'250}),
                                 box({406'250, 153'125, 56'250}, {893'750, 403'125, 256'250}),
                                 box({793'750, 121'875, 18'750}, {1'118'750, 328'125, 131'250})});
  const Reported reported = expect_levels(part, kSmall, layers_of(100'000, 3));
  EXPECT_GT(reported.sampled, 0u);
}

TEST(CoverageShapes, CavitiesAndWhatLiesInThemAreExact) {
  const Triangles part =
      joined({ball({800'000, 350'000, 300'000}, 290'000, 16), reversed(ball({810'000, 350'000, 300'000}, 180'000, 12)),
              ball({800'000, 360'000, 300'000}, 90'000, 8)});
  const Reported reported = expect_levels(part, kSmall, layers_of(150'000, 4));
  EXPECT_EQ(reported.sampled, 0u);
  EXPECT_NEAR(reported.volume_mm3, volume_of(part), 1e-9);
}

TEST(CoverageShapes, AShellInsideOutIsSampled) {
  const Reported reported =
      expect_levels(reversed(ball({800'000, 350'000, 300'000}, 250'000, 12)), kSmall, layers_of(200'000, 3));
  EXPECT_GT(reported.sampled, 0u);
}

TEST(CoverageShapes, BoxesThatTouchAreOneSolid) {
  const Triangles part = joined({box({150'000, 125'000, 0}, {750'000, 475'000, 150'000}),
                                 box({750'000, 100'000, 20'000}, {1'340'000, 475'000, 150'000}),
                                 box({150'000, 475'000, 0}, {750'000, 640'000, 90'000})});
  expect_levels(part, kSmall, layers_of(100'000, 2));
}

TEST(CoverageShapes, RandomTetrahedraOnEdgesOnSamplesAndOffThemHaveTheLevelsOfTheContract) {
  for (unsigned seed = 0; seed < 18; ++seed) {
    std::mt19937 random(seed);
    // Corners on edges and middles of voxels; on samples; anywhere.
    const auto axis = [&](int count, Nm step) {
      if (seed % 3 == 0) return static_cast<Nm>(random() % static_cast<unsigned>(count)) * step;
      if (seed % 3 == 1) return static_cast<Nm>(random() % static_cast<unsigned>(4 * count)) * (step / 4) + step / 8;
      return static_cast<Nm>(random() % static_cast<unsigned>(count * step));
    };
    const auto pick = [&] { return Point3{axis(32, 50'000), axis(28, 25'000), axis(5, 50'000)}; };
    expect_levels(random_tetrahedra(1 + static_cast<int>(seed / 3), pick), kSmall, layers_of(100'000, 2));
    if (HasFailure()) FAIL() << "seed " << seed;
  }
}

TEST(CoverageShapes, CopiesThatOverlapAreSampledOnlyWhereTheirBoxesMeet) {
  const PixelGrid grid{{254, 4'000'000}, {254, 4'000'000}};
  const Triangles part = turned(box({-600'000, -600'000, -250'000}, {600'000, 600'000, 250'000}), 0.2, 0.1, {0, 0, 0});
  const std::vector<Point3> positions{
      {1'000'000, 1'000'000, 400'000}, {2'060'000, 1'270'000, 430'000}, {2'900'000, 3'100'000, 400'000}};
  std::vector<Instance> instances;
  Triangles all;
  for (const Point3& position : positions) {
    instances.push_back({0, position});
    const Triangles copy = turned(part, 0, 0, position);
    all.insert(all.end(), copy.begin(), copy.end());
  }
  Mesh mesh = make_mesh(part), joined_mesh = make_mesh(all);
  const Instance only{0, {0, 0, 0}};
  for (const FillRule rule : {FillRule::kNonzero, FillRule::kEvenOdd}) {
    auto copies = coverage::Coverage::build({&mesh, 1}, instances, grid, rule, 16);
    auto together = coverage::Coverage::build({&joined_mesh, 1}, {&only, 1}, grid, rule, 16);
    coverage::CoverageScratch scratch;
    scratch.counts_held = true;
    Levels of_copies, of_all;
    std::uint64_t held = 0, inspected = 0, sampled = 0;
    for (const Layer& layer : layers_of(90'000, 8, 20'000)) {
      const auto report = copies->layer(layer, scratch, of_copies);
      together->layer(layer, scratch, of_all);
      EXPECT_TRUE(of_copies.row_offset == of_all.row_offset && of_copies.change == of_all.change &&
                  of_copies.level == of_all.level);
      held += report.held_voxels, inspected += report.inspected, sampled += report.sampled_voxels;
    }
    EXPECT_GT(sampled, 0u);
    EXPECT_LT(10 * inspected, 6 * held);  // two of three copies as a whole would be more
  }
}

TEST(CoverageShapes, CopiesOfSeveralMeshesAtAnyHeightAreAsOneMeshOfTheirFacets) {
  const PixelGrid grid{{254, 6'000'000}, {508, 3'300'000}};
  const Triangles ball_part = ball({0, 0, 0}, 300'000, 14), pin = box({0, 0, 0}, {170'000, 130'000, 333'000});
  std::array<Mesh, 2> meshes{make_mesh(ball_part), make_mesh(pin)};
  std::vector<Instance> instances;
  Triangles all;
  for (std::uint32_t i = 0; i < 14; ++i) {
    const auto n = static_cast<Nm>(i);
    const Point3 by{400'000 + 390'013 * n, 500'000 + 1'100'007 * (n % 3), 310'000 + (i % 4 == 3 ? 21'001 : 0)};
    instances.push_back({i % 3 == 1 ? 1u : 0u, by});
    for (Triangle t : i % 3 == 1 ? pin : ball_part) {
      for (Point3* p : {&t.a, &t.b, &t.c}) *p = {p->x + by.x, p->y + by.y, p->z + by.z};
      all.push_back(t);
    }
  }
  Mesh joined_mesh = make_mesh(all);
  const Instance only{0, {0, 0, 0}};
  auto copies = coverage::Coverage::build(meshes, instances, grid, FillRule::kNonzero, 16);
  auto together = coverage::Coverage::build({&joined_mesh, 1}, {&only, 1}, grid, FillRule::kNonzero, 16);
  coverage::CoverageScratch kept, of_all_scratch;
  Levels of_copies, of_all, again;
  double volume = 0;
  for (const Layer& layer : layers_of(90'000, 8)) {
    coverage::CoverageScratch scratch;  // what layers before it left counts for them
    const auto report = copies->layer(layer, scratch, of_copies);
    copies->layer(layer, kept, again);
    EXPECT_TRUE(of_copies.change == again.change && of_copies.level == again.level);
    const auto expected = together->layer(layer, of_all_scratch, of_all);
    EXPECT_EQ(report.facets, expected.facets);
    EXPECT_NEAR(report.volume_mm3, expected.volume_mm3, 1e-9);
    EXPECT_TRUE(of_copies.row_offset == of_all.row_offset && of_copies.change == of_all.change && of_copies.level == of_all.level)
        << "layer " << layer.index;
    EXPECT_LE(report.scratch_bytes, copies->bound(layer).scratch_bytes);
    volume += report.volume_mm3;
  }
  EXPECT_NEAR(volume, volume_of(all), 1e-6);
}

/// Whether a pixel or one of its eight neighbours differs from it.
bool is_next_to_a_change(const std::vector<std::vector<bool>>& set, int row, int column) {
  for (int r = row - 1; r <= row + 1; ++r) {
    for (int c = column - 1; c <= column + 1; ++c) {
      if (set[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] !=
          set[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]) {
        return true;
      }
    }
  }
  return false;
}

std::vector<std::vector<bool>> bits_of(const RunsView& runs) {
  std::vector<std::vector<bool>> set(runs.rows(), std::vector<bool>(runs.columns));
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    const auto row = runs.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) std::fill(set[r].begin() + row[i], set[r].begin() + row[i + 1], true);
  }
  return set;
}

TEST(CoverageShapes, TwoLevelsDifferFromTheBitmapOnlyNextToItsBoundary) {
  const PixelGrid grid{{600, 8'000'000}, {600, 8'000'000}};
  const Triangles part = ball({4'000'000, 4'000'000, 3'000'000}, 2'900'000, 60);
  Mesh of_voxels = make_mesh(part);
  const Instance instance{0, {0, 0, 0}};
  auto coverage = coverage::Coverage::build({&of_voxels, 1}, {&instance, 1}, grid, FillRule::kNonzero, 2);
  auto rasterizer = raster::Rasterizer::build({&of_voxels, 1}, {&instance, 1}, grid, FillRule::kNonzero, false, true);
  coverage::CoverageScratch scratch;
  raster::LayerScratch of_pixels;
  Levels levels;
  Runs pixels, full;
  std::uint64_t differ = 0, solid = 0, far = 0;
  for (const Layer& layer : layers_of(100'000, 59, 50'000)) {
    coverage->layer(layer, scratch, levels);
    rasterizer->layer(raster::Engine::kContours, layer.plane(), of_pixels, pixels);
    threshold_levels(levels, 1, full);
    const auto of_bitmap = bits_of(pixels), of_shares = bits_of(full);
    for (int r = 1; r + 1 < static_cast<int>(grid.rows()); ++r) {
      for (int c = 1; c + 1 < static_cast<int>(grid.columns()); ++c) {
        const auto row = static_cast<std::size_t>(r), column = static_cast<std::size_t>(c);
        solid += of_bitmap[row][column] ? 1 : 0;
        if (of_bitmap[row][column] == of_shares[row][column]) continue;
        ++differ;
        far += is_next_to_a_change(of_bitmap, r, c) ? 0 : 1;
      }
    }
  }
  EXPECT_EQ(far, 0u);
  EXPECT_GT(differ, 0u);
  EXPECT_LT(static_cast<double>(differ), 0.01 * static_cast<double>(solid));
  std::cout << differ << " of " << solid << " pixels differ, all next to the boundary\n";
}

TEST(CoverageShapes, AnOpenMeshIsRefused) {
  Mesh mesh = make_mesh(box({100'000, 100'000, 0}, {200'000, 200'000, 200'000}));
  mesh.closed = false;
  const Instance instance{0, {0, 0, 0}};
  auto coverage = coverage::Coverage::build({&mesh, 1}, {&instance, 1}, kSmall, FillRule::kNonzero, 4);
  ASSERT_FALSE(coverage.ok());
  EXPECT_EQ(coverage.error().fault, Fault::kInput);
}

}  // namespace
}  // namespace lamina::test
