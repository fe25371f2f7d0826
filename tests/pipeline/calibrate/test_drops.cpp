// Tables of pressure drops as people write them, down to the report about them.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "pipeline/calibrate/drops_page.h"
#include "stages/support/text/json_value.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using segment::fit_drops;
using segment::kDarcy;
using test::Directory;
using test::write_text;

constexpr segment::Medium kMedium{0.02, 1e-4};

/// Drops of samples that are permeable by `share` of the first one.
std::string rows(const char* sample, double share) {
  std::string text;
  for (int i = 1; i <= 5; ++i) {
    const double v = 0.1 * i;
    text += std::string(sample) + "," + std::to_string(v) + "," + std::to_string((3e5 * v + 2e4 * v * v) / share * 0.02) + "\n";
  }
  return text;
}

TEST(Drops, AColumnNamesTheSamplesAndTheirSpreadIsReported) {
  const Directory directory;
  const std::string table = directory / "drops.csv";
  write_text(table, "sample,velocity_m_s,drop_pa\n" + rows("left", 1) + rows("right", 2));
  const auto fits = fit_drops(table, {kMedium, {}, {}});
  ASSERT_TRUE(fits.ok());
  const nlohmann::ordered_json json = nlohmann::ordered_json::parse(json_text(as_json(fits->front())));
  ASSERT_EQ(json["samples"].size(), 2);
  EXPECT_EQ(json["samples"][1]["sample"], "right");
  const double first = json["samples"][0]["k1_darcy"], second = json["samples"][1]["k1_darcy"];
  EXPECT_NEAR(second / first, 2, 1e-4);
  const nlohmann::ordered_json& spread = json["spread"]["k1_darcy"];
  EXPECT_NEAR(spread["mean"], (first + second) / 2, 1e-9 * first);
  EXPECT_NEAR(spread["coefficient_of_variation"], 0.4714, 1e-4);  // 1 and 2: sqrt(0.5) / 1.5
  EXPECT_NE(as_text(fits->front()).find("2 samples, each by itself\n  left  k1 "), std::string::npos);
  EXPECT_NE(as_text(fits->front()).find("(47.1 %)"), std::string::npos);
  // One column of drops and no names: nothing but the pooled fit.
  write_text(table, "velocity_m_s,drop_pa\n0.1,605\n0.2,1220\n0.3,1860\n0.4,2500\n");
  const auto plain = fit_drops(table, {kMedium, {}, {}});
  ASSERT_TRUE(plain.ok());
  EXPECT_FALSE(as_json(plain->front()).contains("samples"));
  EXPECT_EQ(as_text(plain->front()).find("sample"), std::string::npos);
}

TEST(Drops, BothFormsAreReportedForAGasAndOneThatFitsAloneIsAlone) {
  const Directory directory;
  const std::string table = directory / "drops.csv";
  write_text(table, "sample,velocity_m_s,drop_pa\n" + rows("left", 1) + rows("right", 1.1));
  const auto fits = fit_drops(table, {kMedium, {}, segment::GasPressures{}});
  ASSERT_TRUE(fits.ok());
  const nlohmann::ordered_json json = nlohmann::ordered_json::parse(json_text(as_json(fits->front())));
  EXPECT_EQ(json["compressible"]["outlet_pa"], 101325);
  EXPECT_EQ(json["compressible"]["samples"].size(), 2);
  EXPECT_LT(json["compressible"]["k2_m"].get<double>(), json["k2_m"].get<double>());  // what expands is faster, and loses more
  EXPECT_TRUE(fits->front().warnings.empty());
  // Darcy's law alone, at an inlet of up to 5 bar: the drop grows less than the flow, so the plain parabola bends downwards.
  std::string text = "velocity_m_s,drop_pa\n";
  for (int i = 1; i <= 6; ++i) {
    const double squares = 1e10 + 2e5 * 0.02 * (1e7 * 0.1 * i + 1e5 * 0.01 * i * i);
    text += std::to_string(0.1 * i) + "," + std::to_string(std::sqrt(squares) - 1e5) + "\n";
  }
  write_text(table, text);
  EXPECT_FALSE(fit_drops(table, {kMedium, {}, {}}).ok());
  const auto gas = fit_drops(table, {kMedium, {2e-5, 1.2}, segment::GasPressures{1e5, 1e5}});
  ASSERT_TRUE(gas.ok()) << gas.error().message;
  ASSERT_EQ(gas->front().warnings.size(), 1);
  EXPECT_FALSE(as_json(gas->front()).contains("k1_darcy"));
  EXPECT_NEAR(as_json(gas->front())["compressible"]["k1_darcy"].get<double>() * kDarcy, 2e-12, 1e-16);
  EXPECT_FALSE(draw(gas->front()).dots.empty());
}

}  // namespace
}  // namespace lamina::pipeline
