#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/cli/terminal/progress.h"

namespace lamina::terminal {
namespace {

TEST(Progress, TellsRateAndTimeLeftOfTheLayersThatWerePlannedNow) {
  EXPECT_EQ(Progress::rate(60, 100, 0, 6), "60/100 layers, 10.0 layers/s, 4.0 s left");
  EXPECT_EQ(Progress::rate(60, 100, 50, 1), "60/100 layers, 10.0 layers/s, 4.0 s left") << "50 were kept by resume";
  EXPECT_EQ(Progress::rate(60, 100, 60, 1), "60/100 layers");
  EXPECT_EQ(Progress::rate(100, 100, 0, 10), "100/100 layers, 10.0 layers/s");
  EXPECT_EQ(Progress::rate(0, 0, 0, 0), "0/0 layers");
}

TEST(Progress, MillionEventsCostNoMillionWrites) {
  Progress progress(Progress::Style::kBar);
  std::string told;
  for (std::uint32_t i = 0; i < 1'000'000; ++i) told += progress.tell(i, 1'000'000);
  told += progress.clear();
  EXPECT_LT(std::count(told.begin(), told.end(), '\r'), 1000);
}

}  // namespace
}  // namespace lamina::terminal
