// Tables 18 to 25 of Di Nisio 2022.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stages/segment/permeability.h"
#include "tests/segment/table.h"

namespace lamina::segment {
namespace {

using test::number;

/// The document's convention: v = Q / 28, L = 0.0255 m, density of water.
std::vector<FlowPoint> points_of(int table) {
  std::vector<FlowPoint> points;
  for (const auto& row : test::table(table)) {
    for (int sample = 1; sample <= 5; ++sample) {
      const double drop = number(row, "sample" + std::to_string(sample) + "_mbar");
      points.push_back({number(row, "flow_l_min") / 28, drop * 100 / 0.0255});
    }
  }
  return points;
}

TEST(Permeability, CoefficientsOfTable25ComeOutOfThe630PressureDrops) {
  const auto expected = test::read_table(std::string(LAMINA_TEST_DIR) + "/reference/dinisio2022/permeability_check.tsv");
  ASSERT_EQ(expected.size(), 7);
  for (int i = 0; i < 7; ++i) {
    const auto points = points_of(18 + i);
    ASSERT_EQ(points.size(), 90);
    const auto fit = fit_permeability(points, {1.87e-5, 998.2});
    ASSERT_TRUE(fit.ok());
    const double k1 = fit->k1_m2 / kDarcy, k2 = fit->k2_m * 1e3;
    const auto& row = expected[static_cast<std::size_t>(i)];
    // What numpy's least squares gives for the same points.
    EXPECT_NEAR(k1, number(row, "k1_fit"), 1e-4) << row.at("configuration");
    EXPECT_NEAR(k2, number(row, "k2_fit"), 1e-4) << row.at("configuration");
    // What is printed; F1.5E100C3 has a misprinted pressure drop.
    const bool misprint = row.at("configuration") == "F1.5E100C3";
    EXPECT_LT(std::abs(k1 / number(row, "k1_published") - 1), misprint ? 0.01 : 0.0005) << row.at("configuration");
    EXPECT_LT(std::abs(k2 / number(row, "k2_published") - 1), misprint ? 0.0351 : 0.0025) << row.at("configuration");
    EXPECT_GT(fit->r_squared, 0.97);
    EXPECT_GT(fit->k1_error_m2, 0);
    EXPECT_LT(fit->k1_error_m2, fit->k1_m2 * 0.1);
    // The density scales k2 alone.
    const auto air = fit_permeability(points, {1.87e-5, 1.2});
    EXPECT_DOUBLE_EQ(air->k1_m2, fit->k1_m2);
    EXPECT_NEAR(air->k2_m * 1e3, number(row, "k2_fit_air_1.2_kg_m3"), 0.0003);
  }
}

TEST(Permeability, ExactParabolasComeBackExactlyAndBadDataIsRefused) {
  std::vector<FlowPoint> points;
  for (int i = 1; i <= 6; ++i) points.push_back({0.1 * i, 3e5 * 0.1 * i + 2e4 * 0.01 * i * i});
  const auto fit = fit_permeability(points, {2e-5, 1.2});
  ASSERT_TRUE(fit.ok());
  EXPECT_NEAR(fit->linear, 3e5, 1e-4);
  EXPECT_NEAR(fit->quadratic, 2e4, 1e-3);
  EXPECT_NEAR(fit->r_squared, 1, 1e-12);
  EXPECT_FALSE(fit_permeability(std::span(points).first(2), {}).ok());
  for (auto& p : points) p.velocity_m_s = 0.3;
  EXPECT_FALSE(fit_permeability(points, {}).ok());
}

TEST(Permeability, ThePlotHasRoundNumbersWhereTheirValuesLie) {
  FlowGroup group{"C3", {}};
  for (int i = 1; i <= 6; ++i) group.points.push_back({0.1 * i, 3e5 * 0.1 * i + 2e4 * 0.01 * i * i});
  const auto fit = fit_permeability(group.points, {2e-5, 1.2});
  ASSERT_TRUE(fit.ok());
  const Plot plot = draw_fit(group, *fit);
  const auto text = [&](const std::string& line) {
    const auto found = std::ranges::find(plot.texts, line, &Plot::Text::line);
    return found == plot.texts.end() ? Plot::Text() : *found;
  };
  EXPECT_NEAR(text("0.4").x, plot.dots[3].x, 1e-9);
  EXPECT_NEAR(text("0.6").x, plot.dots[5].x, 1e-9);
  // 187.2 kPa/m at most: 0, 50, 100, 150.
  const double per_kpa = (text("150").baseline - text("50").baseline) / 100;
  EXPECT_NEAR(text("100").baseline, text("50").baseline + 50 * per_kpa, 1e-9);
  EXPECT_NEAR(plot.dots[5].y - plot.dots[0].y, (187.2 - 30.2) * per_kpa, 1e-9);
  EXPECT_EQ(text("pressure drop / length (kPa/m)").size, 13);
  EXPECT_EQ(text("superficial velocity (m/s)").size, 13);
}

}  // namespace
}  // namespace lamina::segment
