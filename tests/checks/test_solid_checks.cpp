// Which jobs give a warning, and which do not.
#include <gtest/gtest.h>

#include "stages/checks/solid_checks.h"

namespace lamina::checks {
namespace {

const std::vector<std::string> kNames = {"a.stl", "b.stl"};

Box box(Nm width_mm, Nm depth_mm, Nm low_mm, Nm high_mm, Nm x_mm = 0) {
  return {{x_mm * 1'000'000, 0, low_mm * 1'000'000},
          {(x_mm + width_mm) * 1'000'000, depth_mm * 1'000'000, high_mm * 1'000'000}};
}

Sampling fine() {
  Sampling sampling;
  sampling.part = kNames;
  sampling.thickest_mm = 0.1;
  return sampling;
}

std::vector<std::string> codes(const std::vector<Warning>& warnings) {
  std::vector<std::string> all;
  for (const Warning& warning : warnings) all.push_back(warning.code);
  return all;
}

/// The warnings about a block of 1000 mm3 of which so much is planned.
std::vector<Warning> checked(double planned_mm3, const Sampling& sampling, bool closed = true) {
  Tally tally({{box(10, 10, 0, 10), 0, 0, 1000, closed}});
  tally.add_area(0, {0, 0, 1'000'000}, planned_mm3);
  std::vector<Warning> warnings;
  EXPECT_TRUE(check_solids(tally, sampling, warnings).ok());
  return warnings;
}

TEST(LaneResolver, VolumesThatDiffer) {
  using Codes = std::vector<std::string>;
  for (const double sound : {700.0, 950.0, 1000.0, 1100.0}) EXPECT_EQ(codes(checked(sound, fine())), Codes()) << sound;
  for (const double odd : {100.0, 500.0, 1300.0, 8000.0}) EXPECT_EQ(codes(checked(odd, fine())), Codes{"volume"}) << odd;
  EXPECT_EQ(codes(checked(0, fine())), Codes{"part-lost"});
  EXPECT_EQ(codes(checked(8000, fine(), false)), Codes()) << "the volume of an open mesh says nothing";
  Sampling coarse = fine();
  coarse.thickest_mm = 5;
  EXPECT_NE(checked(8000, coarse)[0].text.find("--layer"), std::string::npos);
  EXPECT_EQ(checked(8000, coarse)[0].part, "a.stl");
  Sampling shrunk = fine();
  shrunk.offset_mm = -2;
  EXPECT_EQ(codes(checked(1300, shrunk)), Codes{"volume"});
  shrunk.offset_mm = 2;
  EXPECT_EQ(codes(checked(1300, shrunk)), Codes()) << "grown on purpose";
}

TEST(LaneResolver, WhatShellsHoldTogetherCounts) {
  using Codes = std::vector<std::string>;
  Sampling sampling = fine();
  int requested = 0;
  sampling.union_mm3 = [&](std::uint32_t) { return ++requested, 400.0; };  // of 1000 by the signed sum
  EXPECT_EQ(codes(checked(950, sampling)), Codes());
  EXPECT_EQ(requested, 0) << "only if the volumes differ";
  EXPECT_EQ(codes(checked(400, sampling)), Codes());
  EXPECT_EQ(requested, 1);
  EXPECT_EQ(codes(checked(100, sampling)), Codes{"volume"});
  EXPECT_NE(checked(100, sampling)[0].text.find("100 mm3 are planned where the mesh contains 400 mm3 (25 %)"),
            std::string::npos);
  sampling.union_mm3 = [](std::uint32_t) { return 0.0; };
  EXPECT_EQ(codes(checked(400, sampling)), Codes{"volume"}) << "not known";
}

TEST(LaneResolver, EmptyLayersAmidASolidOnly) {
  const auto layer = [](std::uint32_t i) { return Layer{i, static_cast<Nm>(i) * 1'000'000, 1'000'000}; };
  const auto reported = [&](const std::vector<Solid>& solids, const std::vector<std::uint8_t>& filled) {
    std::vector<Warning> warnings;
    check_layers(solids, filled, layer, warnings);
    return warnings;
  };
  const std::vector<Solid> whole = {{box(5, 5, 0, 6)}}, apart = {{box(5, 5, 0, 2)}, {box(5, 5, 4, 6)}};
  EXPECT_TRUE(reported(whole, {1, 1, 1, 1, 1, 1}).empty());
  EXPECT_TRUE(reported(whole, {0, 1, 1, 1, 1, 0}).empty()) << "both ends";
  EXPECT_TRUE(reported(whole, {0, 0, 0, 0, 0, 0}).empty()) << "reported as an empty job";
  EXPECT_TRUE(reported(apart, {1, 1, 0, 0, 1, 1}).empty()) << "nothing is there";
  const auto gap = reported(whole, {1, 1, 0, 0, 1, 1});
  ASSERT_EQ(gap.size(), 1u);
  EXPECT_EQ(gap[0].layer, 2u);
  EXPECT_EQ(gap[0].z_mm, 2.5);
  EXPECT_NE(gap[0].text.find("2 of 6 layers"), std::string::npos);
}

TEST(LaneResolver, ContoursThatMayMoveFar) {
  const auto reported = [](Nm side_mm, double tolerance_um) {
    Sampling sampling = fine();
    sampling.tolerance_um = tolerance_um;
    const std::vector<Solid> solids = {{box(side_mm, side_mm, 0, 5)}};
    std::vector<Warning> warnings;
    check_tolerance(solids, sampling, warnings);
    return !warnings.empty();
  };
  EXPECT_FALSE(reported(1, 50) || reported(10, 200) || reported(100, 250));
  EXPECT_TRUE(reported(1, 51) && reported(10, 201) && reported(100, 251));
}

TEST(LaneResolver, PartsInTheAir) {
  const auto reported = [](const std::vector<Solid>& solids) {
    std::vector<Warning> warnings;
    check_footing(solids, fine(), warnings);
    return warnings.size();
  };
  EXPECT_EQ(reported({{box(5, 5, 0, 5)}}), 0u);
  EXPECT_EQ(reported({{box(5, 5, 5, 9)}}), 1u);
  EXPECT_EQ(reported({{box(5, 5, 0, 5), 0}, {box(5, 5, 5, 9), 1}}), 0u) << "one stands on the other";
  EXPECT_EQ(reported({{box(5, 5, 0, 5), 0}, {box(5, 5, 5, 9, 20), 1}}), 1u) << "next to it";
  EXPECT_EQ(reported({{box(5, 5, 0, 5), 0}, {box(5, 5, 7, 9), 0}}), 0u) << "one part";
}

}  // namespace
}  // namespace lamina::checks
