// tests/pipeline/pores/test_gradient_runs.cpp: a target with two ends becomes a job of regions, each checked in the one file.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "pipeline/job/file.h"
#include "pipeline/pores/design.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

constexpr double kUnit = 9.869233e-13;  // m2 of a darcy

pipeline::DesignRequest coarse_request() {
  pipeline::DesignRequest request;
  request.machine = "anet-a8";
  request.grid = {10, 40, 20, 2};
  return request;
}

segment::PoreTarget darcies(double darcy) {
  segment::PoreTarget target;
  target.permeability_m2 = darcy * kUnit;
  return target;
}

TEST(DesignedGradient, ATargetThatRisesGivesPermeabilitiesThatRise) {
  const auto steps = segment::steps_of(darcies(70), darcies(150), {1.5, 3, 4.5});
  const auto found = pipeline::design_gradient(coarse_request(), steps, [](double) { return true; });
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_TRUE(found->met);
  ASSERT_EQ(found->steps.size(), 3u);
  double before = 0, resistance = 0, porosity = 0;
  for (const auto& [step, job] : found->steps) {
    const double k1 = job.forward.permeability_m2;
    EXPECT_NEAR(k1, *step.target.permeability_m2, 0.05 * *step.target.permeability_m2);
    EXPECT_GT(k1, before);
    EXPECT_LE(job.miss, found->miss);
    before = k1;
    resistance += 1 / k1 / 3;
    porosity += job.forward.porosity / 3;
  }
  EXPECT_NEAR(found->permeability_m2 * resistance, 1, 1e-9) << "regions of one height in series";
  EXPECT_NEAR(found->porosity, porosity, 1e-12);
  // The ranges of the text are those that were run.
  pipeline::Job job;
  ASSERT_TRUE(pipeline::read_job_text(found->toml, "job.toml", job).ok());
  ASSERT_EQ(job.segment.ranges.size(), 3u);
  EXPECT_EQ(job.segment.ranges[1].from_mm, 1.5);
  EXPECT_EQ(job.segment.ranges[1].to_mm, 3);
  EXPECT_EQ(job.segment.ranges[1].changes.values.thin_mm, found->steps[1].found.design.settings.thin_mm);
  EXPECT_EQ(job.segment.all.thin_mm, found->steps[2].found.design.settings.thin_mm)
      << "a higher part continues with the settings of the top";
}

TEST(DesignedGradient, ARegionThatCannotBeMetEndsTheSearchUnlessTheNearestIsWanted) {
  Directory folder;
  const std::string far = "design --permeability 100:5000 --height 9 --steps 3 --machine anet-a8 --voxel 30 --json -o a.toml";
  const auto refused = run_lamina(words_of(far), folder.path());
  EXPECT_EQ(refused.code, 5);
  EXPECT_NE(refused.err.find("not reachable: from 6 to 9 mm nearest to --permeability 5000 is"), std::string::npos)
      << refused.err;
  const nlohmann::ordered_json json = nlohmann::ordered_json::parse(refused.out);
  ASSERT_EQ(json["steps"].size(), 1u) << "those below were not searched";
  EXPECT_LE(json["runs"], 4);
  EXPECT_FALSE(json.contains("porosity"));
  EXPECT_TRUE(files_below(folder.path()).empty());
  const auto nearest = run_lamina(words_of(far + " --nearest"), folder.path());
  EXPECT_EQ(nearest.code, 0) << nearest.err;
  EXPECT_EQ(nlohmann::ordered_json::parse(nearest.out)["steps"].size(), 3u);
}

TEST(DesignedGradient, ARegionOfTheOneFileIsAsTheSameFillingAlone) {
  const auto steps = segment::steps_of(darcies(150), darcies(80), {1.5, 3});
  const auto found = pipeline::design_gradient(coarse_request(), steps, [](double) { return true; });
  ASSERT_TRUE(found.ok()) << found.error().message;
  for (const auto& [step, one] : found->steps) {
    pipeline::Job job;
    ASSERT_TRUE(pipeline::read_job_text(one.toml, "job.toml", job).ok()) << "of the step's own runs";
    const auto alone =
        pipeline::run_forward(job, "anet-a8", one.design.plan, coarse_request().grid, [](double) { return true; });
    ASSERT_TRUE(alone.ok()) << alone.error().message;
    EXPECT_NEAR(one.forward.permeability_m2 / alone->permeability_m2, 1, 1e-6);
    EXPECT_NEAR(one.forward.pore_width_mm, alone->pore_width_mm, 1e-9);
    EXPECT_NEAR(one.forward.pore_length_mm, alone->pore_length_mm, 1e-9);
  }
  EXPECT_GT(found->steps[0].found.forward.permeability_m2, found->steps[1].found.forward.permeability_m2) << "downwards too";
}

TEST(DesignedGradient, TheCommandWritesRegionsThatExtrudeDeposits) {
  Directory folder;
  write_box(folder / "part.stl", {0, 0, 0}, {12, 12, 2});
  const auto made = run_lamina(words_of("design --pore 0.11x0.9:0.14x0.9 --height 2 --steps 2 --machine anet-a8 --voxel 30 "
                                        "--json --quiet -o a.toml"),
                               folder.path());
  ASSERT_EQ(made.code, 0) << made.err;
  const nlohmann::ordered_json reported = nlohmann::ordered_json::parse(made.out);
  EXPECT_EQ(reported["met"], true);
  ASSERT_EQ(reported["steps"].size(), 2u);
  EXPECT_EQ(reported["steps"][0]["to_mm"], 0.9);
  EXPECT_EQ(reported["steps"][1]["to_mm"], 2.1) << "the layer that reaches the height";
  const auto deposited = run_lamina(words_of("extrude part.stl --job a.toml --json -o a.gcode"), folder.path());
  ASSERT_EQ(deposited.code, 0) << deposited.err;
  const nlohmann::ordered_json summary = nlohmann::ordered_json::parse(deposited.out);
  EXPECT_TRUE(summary["warnings"].empty()) << summary["warnings"].dump();
  EXPECT_EQ(deposited.err.find("none closes"), std::string::npos) << "nothing is said of heights that no layer has\n"
                                                                  << deposited.err;
  for (std::size_t i = 0; i < 2; ++i) {
    const double width = i == 0 ? 0.11 : 0.14;
    EXPECT_NEAR(reported["steps"][i]["pore_mm"][0].get<double>(), width, 0.05 * width);
    EXPECT_NEAR(summary["pores"][i + 1]["width_mm"].get<double>(), width, 0.05 * width);
    EXPECT_NEAR(summary["pores"][i + 1]["length_mm"].get<double>(), 0.9, 0.045);
  }
}

TEST(DesignedGradient, AStepOutOfReachIsNamedWithTheNearest) {
  Directory folder;
  const std::string line =
      "design --pore 0.12x0.9:0.4x0.9 --tops 0.9,1.8 --machine anet-a8 --voxel 30 --quiet --json -o a.toml";
  const auto refused = run_lamina(words_of(line), folder.path());
  EXPECT_EQ(refused.code, 5);
  EXPECT_NE(refused.err.find("not reachable: from 0.9 to 1.8 mm nearest to --pore 0.4x0.9 is --pore 0."), std::string::npos)
      << refused.err;
  const nlohmann::ordered_json one = nlohmann::ordered_json::parse(refused.out);
  ASSERT_EQ(one["steps"].size(), 1u) << "the other region was not searched";
  EXPECT_EQ(one["steps"][0]["from_mm"], 0.9);
  EXPECT_EQ(one["steps"][0]["met"], false);
  EXPECT_TRUE(files_below(folder.path()).empty());
  const auto nearest = run_lamina(words_of(line + " --nearest"), folder.path());
  EXPECT_EQ(nearest.code, 0);
  const nlohmann::ordered_json reported = nlohmann::ordered_json::parse(nearest.out);
  ASSERT_EQ(reported["steps"].size(), 2u);
  EXPECT_EQ(reported["steps"][0]["met"], true);
  EXPECT_EQ(reported["steps"][1]["met"], false);
  EXPECT_EQ(files_below(folder.path()).size(), 1u);
}

TEST(DesignedGradient, WrongEndsAndRegionsAreALine) {
  Directory folder;
  const struct {
    const char* options;
    const char* words;
  } rows[] = {
      {"--porosity 20:24", "a gradient needs the part's height; give --height MM, or --tops"},
      {"--porosity 20:22:24 --height 9", "--porosity: '20:22:24' has more than two ends"},
      {"--porosity 20: --height 9", "--porosity: ''"},
      {"--permeability 60:fast --height 9", "--permeability: 'fast'"},
      {"--pore 0.1x0.9:0.9x0.1 --height 9", "--pore: 0.9 mm is the width"},
      {"--porosity 20:24 --height 9 --steps 1", "--steps: 1 is out of range"},
      {"--porosity 20:24 --height 9 --steps 12", "--steps: 0 to 0.6 mm is less than 3 layers of 0.3 mm; make regions higher"},
      {"--porosity 20:24 --tops 9", "--tops: one region has no gradient"},
      {"--porosity 20:24 --tops 9,4", "--tops: 4.2 mm is not above 9 mm; name the lowest first"},
      {"--porosity 20:24 --tops 3,high", "--tops: 'high'"},
      {"--porosity 20:24 --tops 3,9 --height 9", "--tops says all regions"},
      {"--porosity 20 --height 9", "--height: needs a gradient"},
      {"--porosity 20 --tops 3,9", "--tops: needs a gradient"},
      {"--porosity 20:24 --permeability 9:90 --pore 0.1x1 --height 9", "leave one out"},
  };
  for (const auto& row : rows) expect_refused("design --machine anet-a8 " + std::string(row.options), 2, row.words, folder);
  expect_refused("design --porosity 20:24 --height 9 --machine fdm-2000", 2, "--machine: fdm-2000 writes sml", folder);
}

}  // namespace
}  // namespace lamina::test
