// Tables of a calibration that the model predicts, compared with those that Di Nisio measured and with each other.
#include <gtest/gtest.h>

#include "stages/bead/predicted_tables.h"
#include "stages/segment/calibration.h"
#include "tests/bead/anet.h"

namespace lamina::bead {
namespace {

TEST(PredictedTables, AreACalibrationInOrder) {
  for (const double scale : {1.0, 0.5, 3.0}) {
    const Calibration tables = predicted_tables({0.102, 0.046, 400}, 0.4, 0.3, 15 * scale);
    const Status status = segment::check(tables);
    EXPECT_TRUE(status) << (status ? "" : status.error().message);
    for (std::size_t i = 1; i < tables.by_speed.size(); ++i)
      EXPECT_LT(tables.by_speed[i].thin_mm, tables.by_speed[i - 1].thin_mm + 1e-3) << "the faster the thinner";
  }
}

/// Long thin stretches if speed acts at once, as section 4.1.2 saw it; short ones at the profile's acceleration.
TEST(PredictedTables, AreNearThoseThatWereMeasured) {
  const Calibration at_once = predicted_tables(test::anet(test::set_area(), test::kAtOnce), 0.4, 0.3, 15);
  const Calibration& measured = segment::anet_a8_calibration();
  test::Rms thin, extrusion;
  for (std::size_t i = 0; i < measured.by_speed.size(); ++i) {
    ASSERT_EQ(at_once.by_speed[i].percent, measured.by_speed[i].percent);
    thin.add(at_once.by_speed[i].thin_mm - measured.by_speed[i].thin_mm);
    if (i >= 2) {
      EXPECT_NEAR(at_once.by_speed[i].stable_mm / measured.by_speed[i].stable_mm, 1, 0.08) << measured.by_speed[i].percent;
    }
  }
  for (std::size_t i = 0; i < measured.by_extrusion.size(); ++i)
    extrusion.add(at_once.by_extrusion[i].thin_mm - measured.by_extrusion[i].thin_mm);
  EXPECT_LT(thin.value(), 0.025);
  EXPECT_LT(extrusion.value(), 0.025);
  const Calibration braked = predicted_tables(test::anet(test::kProfileArea, test::kProfile), 0.4, 0.3, 15);
  test::Rms repeated;
  for (std::size_t i = 0; i < measured.repeated.size(); ++i) {
    repeated.add(braked.repeated[i].thick_mm - measured.repeated[i].thick_mm);
    repeated.add(braked.repeated[i].thin_mm - measured.repeated[i].thin_mm);
  }
  EXPECT_LT(repeated.value(), 0.045);
}

TEST(PredictedTables, LengthsGoWithTheLag) {
  const Calibration one = predicted_tables({0.1, 0.05, INFINITY}, 0.4, 0.3, 15);
  const Calibration ten = predicted_tables({0.1, 0.5, INFINITY}, 0.4, 0.3, 15);
  for (std::size_t i = 0; i < one.by_speed.size(); ++i) {
    EXPECT_NEAR(ten.by_speed[i].stable_mm / one.by_speed[i].stable_mm, 10, 0.2);
    EXPECT_NEAR(ten.by_speed[i].thin_mm, one.by_speed[i].thin_mm, 1e-9) << "where it begins";
  }
}

}  // namespace
}  // namespace lamina::bead
