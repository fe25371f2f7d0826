// tests/segment/test_gradient.cpp: regions of a target that changes over the height.
#include <gtest/gtest.h>

#include <cmath>

#include "stages/segment/calibration.h"
#include "stages/segment/design.h"
#include "stages/segment/permeability.h"
#include "tests/segment/slow_printer.h"

namespace lamina::segment {
namespace {

constexpr double kLayer = 0.3;

using test::slow_printer;

PoreTarget void_of(double porosity) {
  PoreTarget target;
  target.porosity = porosity;
  return target;
}

TEST(TargetGradient, RegionsAreWholeLayersAndFillTheHeight) {
  for (const double height : {3.0, 25.4, 10.1, 99.95}) {
    for (const std::uint32_t steps : {2u, 3u}) {
      const auto tops = equal_tops(height, steps, kLayer);
      ASSERT_TRUE(tops.ok()) << tops.error().message;
      ASSERT_EQ(tops->size(), steps);
      EXPECT_GE(tops->back(), height - 1e-9);
      EXPECT_LT(tops->back(), height + kLayer);
      double below = 0;
      for (const double top : *tops) {
        const double layers = (top - below) / kLayer;
        EXPECT_NEAR(layers, std::round(layers), 1e-6);
        EXPECT_NEAR(layers, height / kLayer / steps, 1.01) << "as high as each other, but for a layer";
        below = top;
      }
    }
  }
}

TEST(TargetGradient, TopsMoveToTheNearestEndOfALayerAndTheLastOneUp) {
  const auto tops = whole_tops({4.94, 5.95, 25.4}, kLayer);
  ASSERT_TRUE(tops.ok()) << tops.error().message;
  EXPECT_NEAR(tops->at(0), 4.8, 1e-9);
  EXPECT_NEAR(tops->at(1), 6.0, 1e-9);
  EXPECT_NEAR(tops->at(2), 25.5, 1e-9);
}

TEST(TargetGradient, RegionsThatAreTooLowOrOutOfOrderAreRefused) {
  EXPECT_NE(equal_tops(2, 5, kLayer).error().message.find("less than 3 layers"), std::string::npos);
  EXPECT_NE(whole_tops({5, 5.6}, kLayer).error().message.find("less than 3 layers"), std::string::npos);
  EXPECT_NE(whole_tops({5, 3}, kLayer).error().message.find("not above"), std::string::npos);
  EXPECT_FALSE(whole_tops({5}, kLayer).ok());
  EXPECT_FALSE(whole_tops(std::vector<double>(kMaxRegions + 1, 1), kLayer).ok());
}

TEST(TargetGradient, TargetsGoInAStraightLineFromEndToEndEitherWay) {
  PoreTarget low = void_of(0.2), high = void_of(0.26);
  low.permeability_m2 = high.permeability_m2 = 1e-10;
  const std::vector<double> tops{3, 9, 12};  // middles at 1.5, 6 and 10.5
  const auto up = steps_of(low, high, tops), down = steps_of(high, low, tops);
  EXPECT_DOUBLE_EQ(*up[0].target.porosity, 0.2);
  EXPECT_DOUBLE_EQ(*up[1].target.porosity, 0.23);
  EXPECT_DOUBLE_EQ(*up[2].target.porosity, 0.26);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(*up[i].target.porosity + *down[i].target.porosity, 0.46, 1e-12);
    EXPECT_DOUBLE_EQ(*up[i].target.permeability_m2, 1e-10);
    EXPECT_FALSE(up[i].target.pore_width_mm.has_value());
    EXPECT_EQ(up[i].from_mm, i == 0 ? 0 : tops[i - 1]);
    EXPECT_EQ(up[i].to_mm, tops[i]);
  }
}

TEST(TargetGradient, OneNumberOfLinesMeetsAllThatCanBeMet) {
  const Calibration& calibration = anet_a8_calibration();
  const auto limits = DesignLimits::of(slow_printer(), calibration);
  ASSERT_TRUE(limits.ok()) << limits.error().message;
  const SlotRatio ratio{1, 0.85};
  const std::vector<double> tops{3, 6, 9};
  const auto many = steps_of(void_of(0.20), void_of(0.24), tops);
  const std::uint32_t lines = common_lines(many, *limits, ratio, 0.05);
  ASSERT_GE(lines, 1u);
  for (const TargetStep& step : many) EXPECT_LE(search(step.target, *limits, ratio, {lines, lines}).miss, 0.05);
  const auto few = steps_of(void_of(0.155), void_of(0.17), tops);
  EXPECT_GT(common_lines(few, *limits, ratio, 0.05), 1u) << "one line between segmented ones leaves more open";
  const auto partly = steps_of(void_of(0.20), void_of(0.6), tops);
  EXPECT_GE(common_lines(partly, *limits, ratio, 0.05), 1u) << "what nothing meets does not count";
  EXPECT_EQ(common_lines(steps_of(void_of(0.6), void_of(0.7), tops), *limits, ratio, 0.05), 0u);
}

}  // namespace
}  // namespace lamina::segment
