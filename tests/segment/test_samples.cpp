// The spread between samples, and the law of gases that expand on their way.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "stages/segment/permeability.h"
#include "tests/segment/table.h"

namespace lamina::segment {
namespace {

/// The document's convention: v = Q / 28, L = 0.0255 m, density of water.
constexpr Medium kMedium{0.0255, 1e-3 / 60 * 28};
constexpr Fluid kFluid{1.87e-5, 998.2};

FlowGroup group_of(int table) {
  const auto groups =
      read_flows(std::string(LAMINA_TEST_DIR) + fmt::format("/reference/dinisio2022/table_{}.tsv", table), kMedium);
  EXPECT_TRUE(groups.ok() && groups->size() == 1);
  return groups.ok() ? groups->front() : FlowGroup();
}

TEST(Samples, OfTables18To24DifferByWhatTheirFitsHaveBetweenThem) {
  const auto published = test::table(25);
  // Coefficients of variation of k1 in percent, and mean k1 in darcy: five fits of 18 points each, by a script of its own.
  const double variation[] = {7.1, 7.6, 6.2, 5.7, 5.9, 5.4, 3.0};
  const double mean[] = {100.511, 104.049, 74.181, 183.223, 66.220, 57.403, 223.617};
  for (std::size_t i = 0; i < 7; ++i) {
    const auto fit = fit_group(group_of(18 + static_cast<int>(i)), kFluid);
    ASSERT_TRUE(fit.ok());
    ASSERT_EQ(fit->samples.size(), 5);
    EXPECT_EQ(fit->samples[2].name, "sample3");
    EXPECT_EQ(fit->samples[2].points, 18);
    EXPECT_TRUE(fit->left_out.empty());
    EXPECT_NEAR(fit->k1_m2.coefficient() * 100, variation[i], 0.05) << i;
    EXPECT_NEAR(fit->k1_m2.mean / kDarcy, mean[i], 1e-3) << i;
    EXPECT_NEAR(fit->k1_m2.mean_error, fit->k1_m2.deviation / std::sqrt(5.0), 1e-22);
    // The pooled fit is that of Table 25; F1.5E100C3 has a misprinted drop.
    EXPECT_NEAR(fit->pooled.k1_m2 / kDarcy / test::number(published[i], "k1_darcy"), 1, i == 5 ? 0.01 : 0.0005);
    // Points of one sample scatter less than those of five.
    for (const SampleFit& one : fit->samples) EXPECT_LT(one.fit.scatter_pa_m, fit->pooled.scatter_pa_m);
  }
}

TEST(Samples, SpreadOfThreeValuesByHand) {
  const Spread spread = spread_of({2e-11, 4e-11, 6e-11});
  EXPECT_NEAR(spread.mean, 4e-11, 1e-24);
  EXPECT_NEAR(spread.deviation, 2e-11, 1e-24);
  EXPECT_NEAR(spread.mean_error, 2e-11 / std::sqrt(3.0), 1e-24);
  EXPECT_NEAR(spread.coefficient(), 0.5, 1e-12);
  EXPECT_EQ(spread_of({5}).deviation, 0);
}

TEST(Samples, OneWithoutAParabolaIsLeftOutByName) {
  FlowGroup group{"", {}, {"good", "short", "good too"}};
  for (int i = 1; i <= 4; ++i) {
    const double v = 0.1 * i;
    group.points.push_back({v, 3e5 * v + 2e4 * v * v, 0});
    group.points.push_back({v, 5e5 * v + 3e4 * v * v, 2});
    if (i < 3) group.points.push_back({v, 4e5 * v + 2.5e4 * v * v, 1});
  }
  const auto fit = fit_group(group, {2e-5, 1.2});
  ASSERT_TRUE(fit.ok());
  ASSERT_EQ(fit->samples.size(), 2);
  EXPECT_EQ(fit->samples[1].name, "good too");
  ASSERT_EQ(fit->left_out.size(), 1);
  EXPECT_EQ(fit->left_out[0], "short: 2 points; a fit needs three or more");
  EXPECT_NEAR(fit->k1_m2.mean, (2e-5 / 3e5 + 2e-5 / 5e5) / 2, 1e-17);
}

TEST(Gases, OneSampleByHand) {
  // L = 0.02 m, p_out = 1 bar. v = 1: p_in = 1.2 bar, (1.44 - 1) 1e10 / (2 1e5 0.02) = 1.10e6 Pa/m;
  // v = 2: 1.44 bar, 1.0736e10 / 4000 = 2.684e6. So a + b = 1.10e6, 2 a + 4 b = 2.684e6: a = 858000, b = 242000.
  const double third = std::sqrt(1e10 + 4000 * (858000 * 0.5 + 242000 * 0.25)) - 1e5;
  const std::vector<FlowPoint> points = {{1, 20000 / 0.02}, {2, 44000 / 0.02}, {0.5, third / 0.02}};
  const auto gas = expanded(points, 0.02, {1e5, 1e5});
  ASSERT_TRUE(gas.ok());
  EXPECT_NEAR((*gas)[0].gradient_pa_m, 1.10e6, 1e-6);
  EXPECT_NEAR((*gas)[1].gradient_pa_m, 2.684e6, 1e-6);
  const auto fit = fit_permeability(*gas, {1.8e-5, 1.2});
  ASSERT_TRUE(fit.ok());
  EXPECT_NEAR(fit->k1_m2, 1.8e-5 / 858000, 1e-19);
  EXPECT_NEAR(fit->k2_m, 1.2 / 242000, 1e-14);
  // A flow stated at 2 bar has half the velocities of one at 1 bar, if stated for the same gas.
  const auto meter = expanded(points, 0.02, {1e5, 2e5});
  EXPECT_NEAR((*meter)[1].gradient_pa_m, 1.342e6, 1e-6);
  const auto refused = expanded(std::vector<FlowPoint>{{1, -1.1e5 / 0.02}}, 0.02, {1e5, 1e5});
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("leaves no pressure"), std::string::npos);
}

TEST(Gases, TheEquationIsWhatTheGradientAddsUpToAlongTheMedium) {
  // dp / dx = mu / k1 v + rho / k2 v^2 with v = v0 p0 / p and rho = rho0 p / p0, from the outlet backwards (Runge, Kutta).
  const double k1 = 60 * kDarcy, k2 = 6e-6, length = 0.0255, outlet = 95000, reported = 101325;
  const Fluid air{1.81e-5, 1.204};  // at `reported`
  std::vector<FlowPoint> points;
  for (int i = 1; i <= 6; ++i) {
    const double v0 = 0.5 * i;
    const auto slope = [&](double p) {
      const double v = v0 * reported / p, rho = air.density_kg_m3 * p / reported;
      return air.viscosity_pa_s / k1 * v + rho / k2 * v * v;
    };
    double p = outlet;
    constexpr int kSteps = 400;
    const double h = length / kSteps;
    for (int s = 0; s < kSteps; ++s) {
      const double a = slope(p), b = slope(p + h / 2 * a), c = slope(p + h / 2 * b), d = slope(p + h * c);
      p += h / 6 * (a + 2 * b + 2 * c + d);
    }
    points.push_back({v0, (p - outlet) / length});
  }
  const auto gas = expanded(points, length, {outlet, reported});
  ASSERT_TRUE(gas.ok());
  const auto fit = fit_permeability(*gas, air);
  ASSERT_TRUE(fit.ok());
  EXPECT_NEAR(fit->k1_m2 / k1, 1, 1e-8);
  EXPECT_NEAR(fit->k2_m / k2, 1, 1e-8);
  // The plain form is off by far here: the inlet stands at some 1.5 bar.
  const auto plain = fit_permeability(points, air);
  EXPECT_GT(std::abs(plain->k1_m2 / k1 - 1) + std::abs(plain->k2_m / k2 - 1), 0.1);
}

TEST(Gases, Tables18To24InTheCompressibleFormOfTheDocumentsAirPressure) {
  // p_out = 102600 Pa, Table 10. k1 (D) and k2 (m) by a script of its own, one fit of the 90 points.
  const double k1[] = {100.769, 104.162, 74.733, 183.191, 66.892, 58.431, 224.112};
  const double k2[] = {0.01259, 0.01455, 0.00814, 0.03487, 0.00664, 0.00446, 0.03229};
  for (std::size_t i = 0; i < 7; ++i) {
    const auto gas = expanded(group_of(18 + static_cast<int>(i)).points, kMedium.length_m, {102600, 102600});
    const auto fit = fit_permeability(*gas, kFluid);
    ASSERT_TRUE(fit.ok());
    EXPECT_NEAR(fit->k1_m2 / kDarcy, k1[i], 1e-3);
    EXPECT_NEAR(fit->k2_m, k2[i], 1e-5);
  }
}

}  // namespace
}  // namespace lamina::segment
