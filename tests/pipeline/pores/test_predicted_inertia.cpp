// tests/pipeline/pores/test_predicted_inertia.cpp: Forchheimer's k2 of boxes of voxels.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/pores/pore_page.h"
#include "pipeline/pores/predict_flow.h"
#include "stages/stokes/flow.h"
#include "stages/support/text/json_value.h"
#include "tests/pores/boxes.h"

namespace lamina {
namespace {

/// A pore along z that repeats, of `scale` times 12 x 1 x 16 voxels; `wedge` closes it in part.
VoxelStack pore(std::uint32_t scale, bool wedge, Nm edge) {
  const double unit = scale;
  return pores::testing::stack_of(pores::testing::Voxels(12 * scale, scale, 16 * scale).fill([&](auto x, auto, auto z) {
    const double at = (x + 0.5) / unit, height = (z + 0.5) / unit;
    return at < 2 || (wedge && height > 3 && height < 9 && at < 2 + (height - 3));
  }),
                                  {true, true, true}, {edge, edge, edge});
}

struct Found {
  pipeline::PoreReport report;
  Result<pipeline::Forchheimer> inertia;
};
Found analysis(bool wedge, Nm edge) {
  const VoxelStack voxels = pore(2, wedge, edge / 2), fine = pore(2 * pipeline::kFiner, wedge, edge / 6),
                   coarse = pore(pipeline::kFiner, wedge, edge / 3);
  const pipeline::PoreRasters rasters{voxels, fine, coarse};
  const auto go_on = [](double) { return true; };
  pipeline::FlowRequest request;
  request.axes = {false, false, true};
  const Result<pipeline::PoreReport> report = pipeline::analyse_pores(rasters, request, go_on);
  EXPECT_TRUE(report.ok());
  return {*report, pipeline::analyse_inertia(rasters, *report, go_on)};
}

/// k1 goes with the square of a length, k2 with the length, velocities of a Reynolds number against it.
TEST(PredictedInertia, ScalesAsItsUnitsDo) {
  const Found one = analysis(true, 12'000), large = analysis(true, 36'000);
  ASSERT_TRUE(one.inertia.ok() && large.inertia.ok());
  const pipeline::Forchheimer &small = *one.inertia, &big = *large.inertia;
  EXPECT_GT(small.fit.k2_m, 0);
  EXPECT_GT(small.fit.k2_error_m, 0);
  EXPECT_NEAR(big.fit.k1_m2 / small.fit.k1_m2, 9, 1e-3);
  EXPECT_NEAR(big.fit.k2_m / small.fit.k2_m, 3, 1e-3);
  ASSERT_EQ(small.points.size(), 6u);
  EXPECT_NEAR(big.points[5].velocity_m_s / small.points[5].velocity_m_s, 1.0 / 3, 1e-3);
  EXPECT_NEAR(small.points[5].velocity_m_s * small.reynolds_per_velocity, 40, 4);
  // By hand: void velocity x 4 void / surface x density / viscosity.
  const segment::Fluid air;
  EXPECT_NEAR(small.reynolds_per_velocity, 4 / (one.report.surface_per_mm * 1e3) * air.density_kg_m3 / air.viscosity_pa_s,
              1e-6);
  // The slowest flow is nearly creeping.
  const VoxelStack fine = pore(2 * pipeline::kFiner, true, 2'000);
  const Result<stokes::Grid> grid = stokes::make_grid(fine, pipeline::kFiner, 4);
  stokes::Field field = stokes::field_of(grid->cells);
  const double creeping = stokes::solve(*grid, 2, {}, field)->permeability[2] * grid->cells.unit_m * grid->cells.unit_m;
  const double apparent = air.viscosity_pa_s * small.points[0].velocity_m_s / small.points[0].gradient_pa_m;
  EXPECT_LT(apparent, creeping);
  EXPECT_GT(apparent, 0.8 * creeping);
  const auto json = pipeline::as_json(small);
  EXPECT_EQ(json["points"].size(), 6u);
  EXPECT_NE(pipeline::as_text(small).find("inertia   k2 "), std::string::npos);
}

TEST(PredictedInertia, StraightPoresHaveNone) {
  const Found straight = analysis(false, 12'000);
  if (straight.inertia.ok()) {
    const segment::Fluid air;
    const auto& last = straight.inertia->points.back();
    EXPECT_LT(air.density_kg_m3 / straight.inertia->fit.k2_m * last.velocity_m_s * last.velocity_m_s,
              1e-3 * last.gradient_pa_m);
  } else {
    EXPECT_EQ(straight.inertia.error().fault, Fault::kInput);
    EXPECT_NE(straight.inertia.error().message.find("hardly resists"), std::string::npos);
  }
}

TEST(PredictedInertia, ItsMemoryIsCounted) {
  const VoxelStack voxels = pore(2, true, 6'000), fine = pore(6, true, 2'000), coarse = pore(3, true, 4'000);
  pipeline::FlowRequest request;
  request.memory_bytes = 200 * voxels.view().voxels();
  const auto go_on = [](double) { return true; };
  EXPECT_TRUE(pipeline::analyse_pores({voxels, fine, coarse}, request, go_on).ok());
  request.inertia = true;
  EXPECT_FALSE(pipeline::analyse_pores({voxels, fine, coarse}, request, go_on).ok());
}

}  // namespace
}  // namespace lamina
