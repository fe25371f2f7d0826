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

// The manifest of a job has the hash of the text, so keys that came later are left out at their defaults.
TEST(Extruder, LaterKeysAreWrittenIfTheyWereSetAndReadBack) {
  const std::string plain = "[machine]\nname = \"x\"\n";
  const auto silent = pipeline::read_extruder(plain, "x.toml");
  const auto set = pipeline::read_extruder(
      plain +
          "[retraction]\ninside = true\ndetour_mm = 20\nwipe_mm = 1.5\nlift_mm = 0.2\n[fan]\nfull_layer = 4\n"
          "min_layer_s = 8\nmin_print_mm_s = 12\n[code]\nprogress = true\nobjects = \"klipper\"\nthumbnail_px = [220, 124]\n",
      "x.toml");
  ASSERT_TRUE(silent && set);
  const std::string before = pipeline::extruder_text(*silent), after = pipeline::extruder_text(*set);
  for (const char* key : {"inside", "detour_mm", "wipe_mm", "lift_mm", "full_layer", "min_layer_s", "min_print_mm_s",
                          "progress", "objects", "thumbnail_px"}) {
    EXPECT_EQ(before.find(std::string("\n") + key + " = "), std::string::npos) << key;
    EXPECT_NE(after.find(std::string("\n") + key + " = "), std::string::npos) << key;
  }
  const auto again = pipeline::read_extruder(after, "again.toml");
  ASSERT_TRUE(again);
  EXPECT_EQ(pipeline::extruder_text(*again), after);
  EXPECT_TRUE(again->machine.retraction.inside);
  EXPECT_EQ(again->machine.code.thumbnail_px[1], 124u);
  EXPECT_FALSE(pipeline::read_extruder(plain + "[code]\nobjects = \"all\"\n", "x.toml").ok());
}

}  // namespace
}  // namespace lamina
