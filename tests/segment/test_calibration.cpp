// The tables of Di Nisio 2022 against what the planner says.
#include <gtest/gtest.h>

#include <cmath>

#include "stages/geometry/bead_section.h"
#include "stages/segment/calibration.h"
#include "stages/segment/segmentation.h"
#include "tests/segment/table.h"

namespace lamina::segment {
namespace {

using test::number;
using test::table;

TEST(Calibration, EveryMeasuredValueComesBackAndBetweenThemIsInProportion) {
  const Calibration& anet = anet_a8_calibration();
  ASSERT_TRUE(check(anet).ok());
  double last_speed = 100, last_stable = 0;
  for (const auto& row : table(11)) {
    const double percent = number(row, "thin_speed_percent"), stable = number(row, "stabilisation_distance_mm");
    EXPECT_DOUBLE_EQ(thin_width_at_speed(anet, percent).value, number(row, "thin_width_min_mm"));
    EXPECT_DOUBLE_EQ(stable_distance(anet, percent).value, stable);
    EXPECT_TRUE(stable_distance(anet, percent).inside);
    EXPECT_NEAR(stable_distance(anet, (percent + last_speed) / 2).value, (stable + last_stable) / 2, 1e-12);
    EXPECT_NEAR(number(row, "thin_speed_mm_s"), percent * 15 / 100, 1e-9);
    last_speed = percent;
    last_stable = stable;
  }
  for (const auto& row : table(12)) {
    const double percent = number(row, "thin_extrusion_percent"), width = number(row, "thin_width_min_mm");
    EXPECT_DOUBLE_EQ(thin_width_at_extrusion(anet, percent).value, width);
  }
  EXPECT_FALSE(stable_distance(anet, 500).inside);
  EXPECT_FALSE(stable_distance(anet, 90).inside);
}

TEST(Calibration, ThickSpeedFollowsFromTheExtrusion) {
  for (const auto& row : table(7)) {
    const auto reading = repeated_at(anet_a8_calibration(), number(row, "extrusion_percent"));
    EXPECT_DOUBLE_EQ(reading.thick_speed_percent, number(row, "thick_speed_percent"));
    EXPECT_TRUE(reading.inside);
  }
  EXPECT_NEAR(repeated_at(anet_a8_calibration(), 110).thick_speed_percent, 65, 1e-9);
  EXPECT_FALSE(repeated_at(anet_a8_calibration(), 150).inside);
}

TEST(Calibration, SpacingsOfTables7And8FollowFromTheMeasuredWidths) {
  for (const auto& row : table(7)) {
    const auto widths = repeated_at(anet_a8_calibration(), number(row, "extrusion_percent"));
    EXPECT_NEAR(published_spacing(widths.thick_mm, 0.40), number(row, "spacing_sc_mm"), 1e-9);
    const Spacing exact = spacing_for(widths.thick_mm, widths.continuous_mm, 0);
    EXPECT_NEAR(exact.segmented, number(row, "spacing_sc_mm"), 0.0101);
    EXPECT_NEAR(exact.continuous, 0.40, 0.0067);
    EXPECT_NEAR(spacing_for(widths.thick_mm, widths.continuous_mm, 0.1).segmented, exact.segmented + 0.1, 1e-12);
  }
}

TEST(Calibration, TablesOutOfOrderAreRefusedWithTheirRow) {
  Calibration broken = anet_a8_calibration();
  broken.by_speed[3].percent = 150;
  EXPECT_EQ(check(broken).error().message, "by_speed: row 4: speeds have to be above 100 % and to increase");
  broken = anet_a8_calibration();
  broken.by_extrusion[1].thin_mm = 0;
  EXPECT_EQ(check(broken).error().message, "by_extrusion: row 2: widths have to be above 0");
}

TEST(Bead, AreaAndWidthAreInverse) {
  for (const BeadShape shape : {BeadShape::kStadium, BeadShape::kEllipse, BeadShape::kRectangle}) {
    for (double height = 0.05; height < 0.6; height += 0.05) {
      for (double width = 0.05; width < 1.5; width += 0.03) {
        EXPECT_NEAR(bead_width(bead_area(width, height, shape), height, shape), width, 1e-12);
      }
    }
  }
  // PrusaSlicer and Slic3r: height * (width - height * (1 - pi / 4))
  EXPECT_NEAR(bead_area(0.4, 0.3), 0.3 * (0.4 - 0.3 * (1 - 3.14159265358979 / 4)), 1e-12);
}

Segmentation of_configuration(double thin, double extrusion, std::uint32_t continuous, double sc) {
  const auto widths = repeated_at(anet_a8_calibration(), extrusion);
  Segmentation s;
  s.thin_mm = thin;
  s.thick_extrusion = s.thin_extrusion = extrusion;
  s.thick_speed = widths.thick_speed_percent;
  s.continuous = continuous;
  s.spacing_sc_mm = sc;
  s.thick_width_mm = widths.thick_mm;
  s.thin_width_mm = widths.thin_mm;
  s.continuous_width_mm = widths.continuous_mm;
  return s;
}

TEST(Prediction, PoresOfTable16) {
  // No constant is fitted: lengths within two, widths within 2.2 of the standard deviations that the table prints.
  for (const auto& row : table(16)) {
    const double extrusion = std::stod(row.at("sample").substr(1));
    const double sc = extrusion == 75 ? 0.40 : extrusion == 100 ? 0.43 : 0.49;
    const Pores pores = predict_pores(of_configuration(1.5, extrusion, 1, sc));
    EXPECT_LT(std::abs(pores.length_mm - number(row, "pore_length_mm")), 2 * number(row, "pore_length_pm"));
    EXPECT_LT(std::abs(pores.width_mm - number(row, "pore_width_mm")), 2.2 * number(row, "pore_width_pm"));
    RecordProperty("length_" + row.at("sample"), std::to_string(pores.length_mm));
    RecordProperty("width_" + row.at("sample"), std::to_string(pores.width_mm));
  }
}

TEST(Prediction, AThinIntervalLongerThanTheStabilisationDistanceIsWarnedOf) {
  Segmentation s = of_configuration(4.4, 100, 1, 0.43);
  const Calibration& anet = anet_a8_calibration();
  EXPECT_TRUE(warnings(s, anet).empty());
  s.thin_mm = 4.5;
  ASSERT_EQ(warnings(s, anet).size(), 1);
  EXPECT_NE(warnings(s, anet)[0].text.find("at most 4.45 mm"), std::string::npos) << warnings(s, anet)[0].text;
  s.thin_mm = 1.5;
  s.thick_speed = 100;
  ASSERT_EQ(warnings(s, anet).size(), 1);
  EXPECT_NE(warnings(s, anet)[0].text.find("75 %"), std::string::npos) << warnings(s, anet)[0].text;
}

TEST(Prediction, WrongParametersAreNamedInOneLine) {
  const auto message = [](auto change) {
    Segmentation s = of_configuration(1.5, 100, 1, 0.43);
    change(s);
    const Status status = check(s, 0.4);
    return status.ok() ? std::string() : status.error().message;
  };
  EXPECT_EQ(message([](Segmentation&) {}), "");
  EXPECT_EQ(message([](Segmentation& s) { s.thin_mm = 0; }), "segment.thin_mm: 0 mm; a thin segment has to be longer than 0");
  EXPECT_EQ(message([](Segmentation& s) { s.thin_mm = -1; }), "segment.thin_mm: -1 mm; a thin segment has to be longer than 0");
  EXPECT_EQ(message([](Segmentation& s) { s.thin_speed = 0; }), "segment.thin_speed_percent: 0 %; a speed has to be above 0");
  EXPECT_TRUE(message([](Segmentation& s) { s.spacing_sc_mm = 0.3; }).starts_with("segment.spacing_sc_mm: 0.3 mm is below"));
  EXPECT_TRUE(message([](Segmentation& s) { s.continuous = 0; }).starts_with("segment.continuous_lines: 0"));
}

}  // namespace
}  // namespace lamina::segment
