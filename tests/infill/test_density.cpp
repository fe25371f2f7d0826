// tests/infill/test_density.cpp: fillings by density deposit the volume that they state, and solid ones leave no gap.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "stages/geometry/bead_section.h"
#include "stages/infill/density.h"
#include "stages/infill/gyroid.h"
#include "tests/infill/outlines.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

using infill::FillContext;
using infill::FillParameters;
using infill::Pattern;

FillParameters by_density(Pattern pattern, double density, std::uint32_t walls = 0) {
  FillParameters parameters;
  parameters.pattern = pattern;
  parameters.density = density;
  parameters.walls = walls;
  return parameters;
}

/// mm3 of a layer's beads, walls included.
double volume_of(const Toolpaths& paths, Nm thickness, BeadShape shape = BeadShape::kStadium) {
  double sum = 0;
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      const Point2 a = paths.point[i], b = paths.point[i + 1];
      const double length = std::hypot(mm(std::int64_t{b.x} - a.x), mm(std::int64_t{b.y} - a.y));
      sum += length * bead_area(mm(paths.width[i]), mm(thickness), shape);
    }
  }
  return sum;
}

/// The mean volume of layers over that inside the surface of the 20 mm square.
double share_of(const FillParameters& parameters, Nm thickness, std::uint32_t layers) {
  const Contours& square = outline("square");
  double sum = 0;
  for (std::uint32_t i = 0; i < layers; ++i) {
    FillContext context = context_of(square, i);
    context.layer.bottom = static_cast<Nm>(i) * thickness;
    context.layer.thickness = thickness;
    sum += volume_of(filled(square, context, parameters), thickness, parameters.shape);
  }
  return sum / layers / (400 * mm(thickness));
}

TEST(Density, PitchOfAStadiumIsWidthLessThicknessTimesOneLessQuarterPi) {
  // Hand-calculated: 0.4 - 0.2 x 0.2146018.
  EXPECT_NEAR(infill::solid_pitch(by_density(Pattern::kGrid, 1), 400'000, 200'000), 357'079.6, 0.1);
  FillParameters rectangle = by_density(Pattern::kGrid, 1);
  rectangle.shape = BeadShape::kRectangle;
  EXPECT_NEAR(infill::solid_pitch(rectangle, 400'000, 200'000), 400'000, 0.1);
}

TEST(Density, OfASquareIsWithinAPointForEveryPatternShapeAndThickness) {
  for (const Pattern pattern : {Pattern::kRaster, Pattern::kLines, Pattern::kGrid, Pattern::kGyroid}) {
    for (const BeadShape shape : {BeadShape::kStadium, BeadShape::kRectangle, BeadShape::kEllipse}) {
      for (const Nm thickness : {100'000, 200'000}) {
        const bool gyroid = pattern == Pattern::kGyroid;  // whose layers differ: all heights of the square are its mean
        if (gyroid && (shape != BeadShape::kStadium || thickness != 200'000)) continue;
        for (int percent = 10; percent <= 90; percent += gyroid ? 40 : 10) {
          FillParameters parameters = by_density(pattern, percent / 100.0);
          parameters.shape = shape;
          EXPECT_NEAR(100 * share_of(parameters, thickness, gyroid ? 100 : 2), percent, 1)
              << static_cast<int>(pattern) << ", shape " << static_cast<int>(shape) << ", " << thickness << " nm";
        }
      }
    }
  }
}

TEST(Density, OfAHundredIsTheVolumeAtAnyAngleAndNumberOfWalls) {
  for (const MicroDegrees angle : {0, 45'000'000, 13'000'000, 88'000'000}) {
    for (const std::uint32_t walls : {0u, 1u, 2u, 5u}) {
      FillParameters parameters = by_density(Pattern::kGrid, 1, walls);
      parameters.angle_base = angle;
      const double lost = 1 - share_of(parameters, 200'000, 4);
      EXPECT_LT(lost, 0.015) << angle << ", " << walls;
      EXPECT_GT(lost, -0.005) << angle << ", " << walls;
    }
  }
}

// Walls of opposite sides are no nearer than four fifths of a pitch; a single bead fills what is narrower. Gaps below a quarter
// of a pitch stay: the rib of 0.8 mm has one of 0.04 mm, and loses what two stadia lack of their rectangles.
TEST(Density, OfARibIsItsVolumeForAnyWidth) {
  for (double width = 0.2; width < 2.5; width += 0.05) {
    const Contours rib = contours_of({{{0, 0}, {width, 0}, {width, 20}, {0, 20}}});
    for (const double density : {0.2, 1.0}) {
      if (density < 1 && width > 2) continue;
      const Toolpaths paths = filled(rib, context_of(rib), by_density(Pattern::kGrid, density, 2));
      const double share = volume_of(paths, 200'000) / (width * 20 * 0.2);
      EXPECT_GT(share, 0.88) << width << " mm, " << density;
      EXPECT_LT(share, 1.08) << width << " mm, " << density;
    }
  }
}

TEST(Density, BeadsStayInsideAndWithinTheirBoundForAnyOutline) {
  for (const Outline& outline : outlines()) {
    for (const Pattern pattern : {Pattern::kRaster, Pattern::kLines, Pattern::kGrid, Pattern::kGyroid}) {
      for (const double density : {0.0, 0.15, 0.6, 1.0}) {
        const FillParameters parameters = by_density(pattern, density, 1);
        const FillContext context = context_of(outline.contours, 3);
        const auto made = infill::outlines_of(outline.contours, context, parameters);
        ASSERT_TRUE(made.ok());
        const Toolpaths paths = filled(outline.contours, context, parameters);
        const auto bound = infill::bound_fill(outline.contours, *made, context, parameters);
        ASSERT_TRUE(bound.ok());
        ASSERT_LE(paths.point.size(), bound->points) << outline.name << ", pattern " << static_cast<int>(pattern);
        const std::size_t step = 1 + paths.point.size() * outline.contours.point.size() / 100'000;
        for (std::size_t i = 0; i < paths.point.size(); i += step) {
          const Point2 p = paths.point[i];
          ASSERT_TRUE(winding_about(outline.contours, p) != 0 || distance_to(outline.contours, p.x, p.y) < 3)
              << outline.name << ", pattern " << static_cast<int>(pattern) << ", density " << density;
        }
      }
    }
  }
}

TEST(Density, SparseLinesAreAtTheSamePositionsInLayersOfAnyThickness) {
  const Contours& square = outline("square");
  FillParameters parameters = by_density(Pattern::kGrid, 0.2);
  parameters.nominal_thickness = 300'000;
  FillContext thick = context_of(square, 0), thin = context_of(square, 1);
  thick.layer.thickness = 300'000;
  thin.layer.thickness = 100'000;
  const Toolpaths a = filled(square, thick, parameters), b = filled(square, thin, parameters);
  EXPECT_TRUE(a.point == b.point);
  EXPECT_EQ(a.width[0], 400'000);
  // Hand-calculated: pitch 0.4 - 0.3 x 0.2146018 = 0.3356194; width 0.3356194 + 0.1 x 0.2146018.
  EXPECT_NEAR(b.width[0], 357'080, 1);
  EXPECT_NEAR(volume_of(a, 300'000) / volume_of(b, 100'000), 3, 1e-4);
}

TEST(Density, SkinsLeaveNothingBetweenSparseAndSolid) {
  const Contours& square = outline("square");
  const FillParameters parameters = by_density(Pattern::kGrid, 0.2);
  auto made = infill::outlines_of(square, context_of(square), parameters);
  ASSERT_TRUE(made.ok());
  const Contours covered = contours_of({{{0, 0}, {8, 0}, {8, 20}, {0, 20}}});
  ASSERT_TRUE(infill::divide_skins(covered, context_of(square), parameters, *made).ok());
  // The solid side reaches a bead's width further.
  EXPECT_NEAR(square_mm(doubled_area(made->region)), 20 * 7.6, 0.01);
  EXPECT_NEAR(square_mm(doubled_area(made->solid)), 20 * 12.4, 0.01);
  Toolpaths paths;
  ASSERT_TRUE(infill::append_fill(*made, context_of(square), parameters, paths).ok());
  double solid = 0;
  for (std::size_t i = 0; i + 1 < paths.point.size(); ++i) solid += paths.kind[i] == PathKind::kSolid ? 1 : 0;
  EXPECT_GT(solid, 40);
}

// A fin of 0.7 mm, too narrow for sparse lines: solid where a skin reaches it, sparse further away.
TEST(Density, NarrowRegionsAreSolidNextToFacesAlone) {
  const Contours comb = contours_of({{{0, 0}, {20, 0}, {20, 20}, {19.3, 20}, {19.3, 5}, {0.7, 5}, {0.7, 20}, {0, 20}}});
  const FillParameters parameters = by_density(Pattern::kGrid, 0.2, 0);
  auto made = infill::outlines_of(comb, context_of(comb), parameters);
  ASSERT_TRUE(made.ok());
  const Contours covered = contours_of({{{0, 0}, {20, 0}, {20, 10}, {19.3, 10}, {19.3, 5}, {0.7, 5}, {0.7, 20}, {0, 20}}});
  ASSERT_TRUE(infill::divide_skins(covered, context_of(comb), parameters, *made).ok());
  // The right fin above 10 mm, and what is narrow within three widths of that.
  EXPECT_NEAR(square_mm(doubled_area(made->solid)), 0.7 * (10 + 3 * 0.4), 0.02);
  EXPECT_NEAR(square_mm(doubled_area(made->region)) + square_mm(doubled_area(made->solid)), 100 + 2 * 0.7 * 15, 1e-3);
}

TEST(Density, SettingsOfGapsAreRefused) {
  const auto refused = [](auto change) {
    FillParameters parameters = by_density(Pattern::kRaster, 0.5);
    EXPECT_TRUE(infill::check(parameters).ok());
    change(parameters);
    return !infill::check(parameters).ok();
  };
  EXPECT_TRUE(refused([](FillParameters& p) { p.group = 2; }));
  EXPECT_TRUE(refused([](FillParameters& p) { p.stagger = {0, 100'000}; }));
  EXPECT_TRUE(refused([](FillParameters& p) { p.first_line = 100'000; }));
  EXPECT_TRUE(refused([](FillParameters& p) { p.end_inset = 0; }));
  EXPECT_TRUE(refused([](FillParameters& p) { p.longest_link = 0; }));
}

TEST(TouchingDistance, IsTheMeanOfLinesWithoutGaps) {
  FillParameters fill;
  EXPECT_EQ(infill::touching_distance(fill), 400'000);
  fill.distances = {400'000, 360'000};
  EXPECT_EQ(infill::touching_distance(fill), 380'000);
  fill.distances = {400'001};
  EXPECT_FALSE(infill::touching_distance(fill));
  fill.distances.clear();
  fill.gaps = {-40'000, 0};
  EXPECT_EQ(infill::touching_distance(fill), 380'000);
  fill.group = 2;
  EXPECT_EQ(infill::touching_distance(fill), 390'000);
  fill.gaps = {100'000};
  EXPECT_FALSE(infill::touching_distance(fill));
  fill.gaps = {0};
  fill.density = 1;
  EXPECT_FALSE(infill::touching_distance(fill));
}

TEST(Density, UnlinkedPatternsNeedOne) {
  for (const Pattern pattern : {Pattern::kLines, Pattern::kGrid, Pattern::kGyroid}) {
    FillParameters parameters;
    parameters.pattern = pattern;
    EXPECT_FALSE(infill::check(parameters).ok());
    parameters.density = 0.2;
    EXPECT_TRUE(infill::check(parameters).ok());
  }
  EXPECT_FALSE(infill::check(by_density(Pattern::kHoneycomb, 0.2)).ok());
  EXPECT_FALSE(infill::check(by_density(Pattern::kGrid, 1.01)).ok());
  EXPECT_FALSE(infill::check(by_density(Pattern::kGrid, NAN)).ok());
}

/// sin x cos y + sin y cos z + sin z cos x, angles in radians.
double gyroid_at(double x, double y, double z) {
  return std::sin(x) * std::cos(y) + std::sin(y) * std::cos(z) + std::sin(z) * std::cos(x);
}

TEST(Gyroid, CurvesAreOnTheSurfaceAndNumberedAcross) {
  constexpr double kPeriod = 5e6, kTurn2 = 2 * std::numbers::pi / kPeriod;
  for (const double z : {0.0, 3e5, 8e5, 1.3e6, 2.2e6, 3.3e6, 4.9e6}) {
    const infill::GyroidSection section(z, kPeriod);
    Contours curves;
    section.append_curves({-7'000'000, -9'000'000}, {11'000'000, 8'000'000}, curves);
    ASSERT_GT(curves.size(), 4u);
    EXPECT_LE(curves.point.size(), section.count_points({-7'000'000, -9'000'000}, {11'000'000, 8'000'000}));
    std::int64_t last = INT64_MIN;
    for (std::uint32_t c = 0; c < curves.size(); ++c) {
      const std::int64_t number = section.nearest_curve(curves[c][curves[c].size() / 2]);
      EXPECT_GT(number, last);
      last = number;
      for (const Point2 p : curves[c]) {
        EXPECT_NEAR(gyroid_at(p.x * kTurn2, p.y * kTurn2, z * kTurn2), 0, 1e-5);
        EXPECT_EQ(section.nearest_curve(p), number);
      }
    }
  }
}

TEST(Gyroid, LengthIsThatOfTheZeroLineOnAGrid) {
  // Marching squares over one period of the function, without its solution.
  constexpr int kCells = 150, kHeights = 40;
  const double step = 2 * std::numbers::pi / kCells;
  double sum = 0;
  for (int k = 0; k < kHeights; ++k) {
    const double z = (k + 0.5) * 2 * std::numbers::pi / kHeights;
    for (int i = 0; i < kCells; ++i) {
      for (int j = 0; j < kCells; ++j) {
        const double x[5] = {i * step, (i + 1) * step, (i + 1) * step, i * step, i * step};
        const double y[5] = {j * step, j * step, (j + 1) * step, (j + 1) * step, j * step};
        double cut[2][2];
        int cuts = 0;
        for (int e = 0; e < 4 && cuts < 2; ++e) {
          const double a = gyroid_at(x[e], y[e], z), b = gyroid_at(x[e + 1], y[e + 1], z);
          if ((a < 0) == (b < 0)) continue;
          cut[cuts][0] = x[e] + (x[e + 1] - x[e]) * a / (a - b);
          cut[cuts++][1] = y[e] + (y[e + 1] - y[e]) * a / (a - b);
        }
        if (cuts == 2) sum += std::hypot(cut[1][0] - cut[0][0], cut[1][1] - cut[0][1]);
      }
    }
  }
  EXPECT_NEAR(infill::gyroid_length(), sum / kHeights / (2 * std::numbers::pi), 0.01);
}

}  // namespace
}  // namespace lamina::test
