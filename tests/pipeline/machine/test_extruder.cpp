// The extrusion printer of a job: what the job changes, and where its widths come from.
#include <gtest/gtest.h>

#include "pipeline/machine/profiles.h"

namespace lamina {
namespace {

Result<ExtruderProfile> printer_with_lag(const std::string& machine, const std::string& lag_s) {
  pipeline::Job job;
  job.machine.profile = machine;
  job.fill.all.width_mm = 0.45;
  job.layer_mm = 0.2;
  job.extrude.machine = {{"material.lag_s", lag_s}};
  Result<ExtruderProfile> profile = pipeline::resolve_extruder(job);
  if (profile) pipeline::predict_calibration(job, *profile);
  return profile;
}

TEST(Extruder, WidthsOfAPrinterWhoseLagIsKnownArePredictedUnlessTheyWereMeasured) {
  const auto known = printer_with_lag("klipper", "0.05"), unknown = printer_with_lag("klipper", "0");
  const auto measured = printer_with_lag("anet-a8", "0.05");
  ASSERT_TRUE(known && unknown && measured);
  EXPECT_TRUE(known->predicted_calibration);
  EXPECT_EQ(known->calibration.width_mm, 0.45);
  EXPECT_EQ(known->calibration.height_mm, 0.2);
  EXPECT_EQ(known->calibration.speed_mm_s, known->machine.speed.print_mm_s);
  EXPECT_FALSE(unknown->predicted_calibration);
  EXPECT_FALSE(measured->predicted_calibration);
  EXPECT_EQ(unknown->calibration.width_mm, measured->calibration.width_mm) << "those of another machine";
}

TEST(Extruder, AnAccelerationIsStatedByAProfileOrAJobOnly) {
  const std::string plain = "[machine]\nname = \"x\"\n[speed]\nprint_mm_s = 30\n";
  const auto silent = pipeline::read_extruder(plain, "x.toml");
  const auto stated = pipeline::read_extruder(plain + "acceleration_mm_s2 = 800\n", "x.toml");
  ASSERT_TRUE(silent && stated);
  EXPECT_FALSE(silent->machine.speed.states_acceleration);
  EXPECT_TRUE(stated->machine.speed.states_acceleration);
  EXPECT_EQ(pipeline::extruder_text(*silent).find("acceleration_mm_s2"), std::string::npos);
  EXPECT_NE(pipeline::extruder_text(*stated).find("acceleration_mm_s2 = 800"), std::string::npos);
  const auto wrong = pipeline::read_extruder(plain + "acceleration_mm_s2 = 0\n", "x.toml");
  EXPECT_FALSE(wrong.ok());
}

}  // namespace
}  // namespace lamina
