#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/cli/terminal/progress.h"

namespace lamina::pipeline {
namespace {

TEST(Progress, ReportsRateAndTimeLeftOfTheLayersThatWerePlannedNow) {
  EXPECT_EQ(Progress::rate(60, 100, 0, 6), "60/100 layers, 10.0 layers/s, 4.0 s left");
  EXPECT_EQ(Progress::rate(60, 100, 50, 1), "60/100 layers, 10.0 layers/s, 4.0 s left") << "50 were kept by resume";
  EXPECT_EQ(Progress::rate(60, 100, 60, 1), "60/100 layers");
  EXPECT_EQ(Progress::rate(100, 100, 0, 10), "100/100 layers, 10.0 layers/s");
  EXPECT_EQ(Progress::rate(0, 0, 0, 0), "0/0 layers");
}

TEST(Progress, MillionEventsCostNoMillionWrites) {
  Progress progress(Progress::Style::kBar);
  std::string reported;
  for (std::uint32_t i = 0; i < 1'000'000; ++i) reported += progress.report(i, 1'000'000);
  reported += progress.clear();
  EXPECT_LT(std::count(reported.begin(), reported.end(), '\r'), 1000);
}

}  // namespace
}  // namespace lamina::pipeline
