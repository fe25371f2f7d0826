// Machine profiles by name and as text.
#include "pipeline/machine/profiles.h"

#include <gtest/gtest.h>

namespace lamina::pipeline {
namespace {

TEST(ShippedProfiles, AreTheTenThatTheDocumentsNameAndTheirTextReadsBackTheSame) {
  EXPECT_EQ(shipped_machines().size(), 11u);
  for (const ShippedProfile& shipped : shipped_machines()) {
    const auto machine = read_machine(shipped.text, std::string(shipped.name));
    ASSERT_TRUE(machine.ok()) << machine.error().message;
    EXPECT_EQ(machine->name, shipped.name);
    const std::string text = pipeline::machine_text(*machine);
    const auto again = read_machine(text, "text");
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(pipeline::machine_text(*again), text);
    const auto kept = read_machine(pipeline::kept_machine_text(*machine), "kept");
    ASSERT_TRUE(kept.ok()) << kept.error().message;
    EXPECT_EQ(pipeline::machine_text(*kept), text) << "what the kept text leaves out has its default";
    EXPECT_TRUE(resolve_profile(*machine).ok()) << resolve_profile(*machine).error().message;
  }
}

TEST(Profiles, AreFoundByNameAndErrorsNameLineAndColumn) {
  const auto nuferbj = find_machine("nuferbj");
  ASSERT_TRUE(nuferbj.ok());
  EXPECT_FALSE(find_machine("nuferbk").ok());
  EXPECT_NE(find_machine("nuferbk").error().message.find("did you mean"), std::string::npos);
  const auto wrong = read_machine("[machine]\nname = \"x\"\ndialect = \"klingon\"\n", "x.toml");
  ASSERT_FALSE(wrong.ok());
  EXPECT_NE(wrong.error().message.find("x.toml:3:11: machine.dialect: unknown value 'klingon'; use one of"), std::string::npos);
  const auto unknown = read_machine("[machine]\nname = \"x\"\n[head]\nnozzels = 3\n", "x.toml");
  ASSERT_FALSE(unknown.ok());
  EXPECT_TRUE(unknown.error().message.starts_with("x.toml:4:")) << unknown.error().message;
  EXPECT_NE(unknown.error().message.find("head.nozzels: no such key"), std::string::npos) << unknown.error().message;
}

// Without voids each saturation would be one that drops do not reach.
TEST(Profiles, OfPowderWithoutVoidsAreReportedByThatKey) {
  for (const char* packing : {"1", "0.995", "0"}) {
    const auto solid = read_machine("[machine]\nname = \"x\"\n[powder]\npacking = " + std::string(packing) + "\n", "x.toml");
    ASSERT_FALSE(solid.ok()) << packing;
    EXPECT_EQ(solid.error().message,
              "x.toml:4:11: powder.packing: " + std::string(packing) + " is out of range; give a number from 0.01 to 0.99");
  }
}

TEST(Profiles, ExtrusionPrintersReadBackTheSameAndHaveTheirCalibrationOrThePublishedOne) {
  for (const ShippedProfile& shipped : shipped_extruders()) {
    const auto profile = find_extruder(std::string(shipped.name));
    ASSERT_TRUE(profile.ok()) << profile.error().message;
    EXPECT_FALSE(profile->calibration.by_speed.empty()) << shipped.name;
    const std::string text = pipeline::extruder_text(*profile);
    const auto again = read_extruder(text, "text");
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(pipeline::extruder_text(*again), text);
    EXPECT_EQ(again->own_calibration, profile->own_calibration);
  }
  const auto powder = read_extruder("[head]\nnozzles = 3\n", "x.toml");
  ASSERT_FALSE(powder.ok());
  EXPECT_EQ(powder.error().message, "x.toml: is the profile of a powder printer; lamina jet takes it");
  const auto rows =
      read_extruder("[machine]\nname = \"x\"\n[calibration]\nby_speed = [[150, 0.3, 1, 0.5], [125, 0.3, 1, 0.5]]\n", "x.toml");
  ASSERT_FALSE(rows.ok());
  EXPECT_EQ(rows.error().message, "x.toml: calibration.by_speed: row 2: speeds have to be above 100 % and to increase");
}

}  // namespace
}  // namespace lamina::pipeline
