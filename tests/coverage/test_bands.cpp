// Bands of rows: pieces of facets, wide stretches of columns, and the same levels with any instructions.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "stages/coverage/coverage.h"
#include "tests/coverage/oracle.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

const PixelGrid kWide{{254, 103'700'000}, {254, 1'900'000}};  // 1037 x 19 voxels of 0.1 mm

struct BandLayer {
  Levels image;
  coverage::CoverageReport report;
};

BandLayer band_layer(const Triangles& triangles, std::uint32_t levels, Isa isa = Isa::kAuto) {
  Mesh mesh = make_mesh(triangles);
  const Instance instance{0, {0, 0, 0}};
  auto coverage = coverage::Coverage::build({&mesh, 1}, {&instance, 1}, kWide, FillRule::kNonzero, levels, isa);
  EXPECT_TRUE(coverage.ok());
  coverage::CoverageScratch scratch;
  scratch.counts_held = true;
  BandLayer made;
  // A layer before it: what it leaves behind must not show.
  coverage->layer({0, -40'000, 100'000}, scratch, made.image);
  made.report = coverage->layer({1, 0, 100'000}, scratch, made.image);
  return made;
}

int level_of(const LevelsView& image, std::uint32_t column, std::uint32_t geometry_row) {
  const std::uint32_t r = image.rows() - 1 - geometry_row;
  for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i) {
    if (image.change[2 * i] <= column && column < image.change[2 * i + 1]) return image.level[i];
  }
  return 0;
}

void add(Triangles& to, const Triangles& more) { to.insert(to.end(), more.begin(), more.end()); }

Triangles pin(Point3 at, Nm size) {
  Triangles out;
  add_tetrahedron(out, at, {at.x + size, at.y, at.z}, {at.x, at.y + size, at.z}, {at.x, at.y, at.z + size});
  return out;
}

/// A box over nearly all columns whose top lies within the layer, hollows below its top and pins above it.
Triangles flat_top(Nm top) {
  Triangles all = box({120'000, 230'000, 0}, {103'410'000, 1'630'000, top});
  for (const Nm x : {20'020'000, 20'130'001, 47'700'000, 90'000'017}) {
    add(all, reversed(pin({x, 730'000, 9'000}, 3)));
    add(all, reversed(pin({x + 1'000'000, 830'000, 2'000}, 7'001)));
    add(all, pin({x + 2'000'000, 930'000, 93'000}, 5'003));
  }
  return all;
}

TEST(CoverageBands, FlatTopsWithinALayerAreOneShareButForWhatLiesBelowAndAboveThem) {
  for (const Nm top : {16'600, 50'000, 83'000, 50'001}) {
    const Triangles all = flat_top(top);
    for (const std::uint32_t levels : {2u, 4u, 51u}) {
      const BandLayer made = band_layer(all, levels);
      for (const std::uint32_t left : {0u, 190u, 198u, 210u, 220u, 476u, 487u, 497u, 700u, 899u, 909u, 919u, 1030u}) {
        const VoxelWindow window{left, std::min(left + 7, kWide.columns()), 0, kWide.rows()};
        const auto facts = oracle_voxels(all, kWide, {1, 0, 100'000}, window);
        std::size_t at = 0;
        for (std::uint32_t j = window.first; j < window.last; ++j) {
          for (std::uint32_t i = window.left; i < window.right; ++i, ++at) {
            ASSERT_EQ(level_of(made.image, i, j), oracle_level(facts[at], FillRule::kNonzero, levels))
                << "top at " << top << ", " << levels << " levels, voxel " << i << ", " << j;
          }
        }
      }
      EXPECT_LT(made.report.exact_voxels, 12u * kWide.rows()) << "a tie along a row is decided once between two hollows";
    }
  }
}

TEST(CoverageBands, AHollowOfThirtyNanometresBreaksATie) {
  for (const Nm rise : {0, 1, 10}) {  // of the hollow's floor: only where it is 0 the band has faces at two heights
    Triangles all = box({100'000, 200'000, 0}, {100'100'000, 1'600'000, 50'000}), hollow;
    const Point3 at{50'000'010, 800'010, 20'000};
    add_tetrahedron(hollow, at, {at.x + 30, at.y, at.z + rise}, {at.x, at.y + 30, at.z + 2 * rise}, {at.x, at.y, at.z + 30});
    add(all, reversed(hollow));
    const BandLayer made = band_layer(all, 2);
    EXPECT_EQ(level_of(made.image, 499, 8), 1);
    EXPECT_EQ(level_of(made.image, 500, 8), 0) << "a floor that rises by " << rise << " nm";
    EXPECT_EQ(level_of(made.image, 501, 8), 1);
  }
}

TEST(CoverageBands, AnyInstructionsGiveTheSame) {
  std::mt19937 random(5);
  const auto anywhere = [&](Nm from, Nm to) { return from + static_cast<Nm>(random() % static_cast<unsigned>(to - from)); };
  for (int turn = 0; turn < 8; ++turn) {
    Triangles all = turn % 2 == 0 ? flat_top(50'000) : Triangles();
    for (int i = 0; i < 40; ++i) {
      const Nm x = anywhere(0, 90'000'000), size = turn < 4 ? 90'000 : 9'000'000;
      const auto pick = [&] { return Point3{x + anywhere(0, size), anywhere(0, 1'900'000), anywhere(-90'000, 190'000)}; };
      Triangles one;
      add_tetrahedron(one, pick(), pick(), pick(), pick());
      add(all, i % 3 == 0 ? reversed(one) : one);
    }
    const BandLayer widest = band_layer(all, 16);
    for (const Isa isa : {Isa::kPlain, Isa::kAvx2}) {
      const BandLayer other = band_layer(all, 16, isa);
      EXPECT_EQ(widest.image.row_offset, other.image.row_offset);
      EXPECT_EQ(widest.image.change, other.image.change);
      EXPECT_EQ(widest.image.level, other.image.level);
      EXPECT_EQ(widest.report.volume_mm3, other.report.volume_mm3);
      EXPECT_EQ(widest.report.exact_voxels, other.report.exact_voxels);
      EXPECT_EQ(widest.report.sampled_voxels, other.report.sampled_voxels);
      EXPECT_EQ(widest.report.held_voxels, other.report.held_voxels);
    }
    EXPECT_GT(widest.report.sampled_voxels, 0u);
  }
}

TEST(CoverageBands, TrapezoidsTileAFacetFromItsHighestCornerDown) {
  const coverage::Edges rows(kWide.y);
  std::mt19937 random(7);
  const auto pick = [&] {
    const auto at = [&](unsigned to) { return static_cast<Nm>(random() % to); };
    return Point3{at(90'000'000), at(19) * 100'000, at(300'000)};
  };
  int taken = 0;
  for (int i = 0; i < 2000; ++i) {
    coverage::SlabFacet facet;
    if (!coverage::take_facet({pick(), pick(), pick()}, false, 100'000, 200'000, rows, facet)) continue;
    ++taken;
    Buffer<coverage::Trapezoid> pieces;
    coverage::cut_trapezoids(facet, 0, rows, pieces);
    ASSERT_GE(pieces.size(), 1u);
    ASSERT_LT(pieces.size(), facet.corners);
    double area = 0, low = pieces.front().high;
    for (const coverage::Trapezoid& piece : pieces) {
      EXPECT_EQ(piece.high, low);
      low = piece.low;
      const auto height = [&](double y) {
        return piece.back.z + (y - piece.back.y) * piece.back.dz - piece.on.z - (y - piece.on.y) * piece.on.dz;
      };
      area += (height(piece.low) + height(piece.high)) / 2 * (piece.high - piece.low);
      EXPECT_LE(coverage::edge(kWide.y, piece.first_row), piece.from_y + piece.low);
      EXPECT_GE(coverage::edge(kWide.y, piece.last_row + 1), piece.from_y + piece.high);
    }
    double of_corners = 0;
    for (std::uint32_t k = 1; k + 1 < facet.corners; ++k) {
      of_corners += ((facet.z[k] - facet.z[0]) * (facet.y[k + 1] - facet.y[0]) -
                     (facet.y[k] - facet.y[0]) * (facet.z[k + 1] - facet.z[0])) /
                    2;
    }
    EXPECT_NEAR(area, of_corners, 1e-2) << "nm^2";
  }
  EXPECT_GT(taken, 1000);
}

}  // namespace
}  // namespace lamina::test
