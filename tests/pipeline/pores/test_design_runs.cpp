// tests/pipeline/pores/test_design_runs.cpp: a target becomes a job whose forward run meets it.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "pipeline/job/file.h"
#include "pipeline/pores/design.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

constexpr double kDarcy = 9.869233e-13;
constexpr pipeline::ForwardGrid kCoarse{10, 40, 20, 2};

pipeline::DesignRequest target_of(double porosity, double darcy) {
  pipeline::DesignRequest request;
  request.machine = "anet-a8";
  request.grid = kCoarse;
  if (porosity > 0) request.target.porosity = porosity;
  if (darcy > 0) request.target.permeability_m2 = darcy * kDarcy;
  return request;
}

bool go_on(double) { return true; }

TEST(DesignedJob, TheForwardRunOfWhatIsWrittenMeetsTheTarget) {
  const auto found = pipeline::design_job(target_of(0.23, 180), go_on);
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_TRUE(found->met);
  EXPECT_NEAR(found->forward.porosity, 0.23, 0.05 * 0.23);
  EXPECT_NEAR(found->forward.permeability_m2 / kDarcy, 180, 0.05 * 180);
  EXPECT_GT(found->model_ratio, 0.6) << "the model of slots overestimates permeability, by less than half";
  EXPECT_LT(found->model_ratio, 1.05);
  // The same from the text that is written.
  pipeline::Job job;
  ASSERT_TRUE(pipeline::read_job_text(found->toml, "job.toml", job).ok());
  EXPECT_TRUE(job.segment.all.on);
  EXPECT_EQ(job.segment.all.thin_mm, found->design.settings.thin_mm);
  EXPECT_EQ(job.segment.all.spacing_sc_mm, found->design.settings.spacing_sc_mm);
  const auto again = pipeline::run_forward(job, "anet-a8", found->design.plan, kCoarse, go_on);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->permeability_m2, found->forward.permeability_m2);
  EXPECT_EQ(again->porosity, found->forward.porosity);
}

TEST(DesignedJob, TheVoidOfAForwardRunIsThatOfTheSlots) {
  const auto found = pipeline::design_job(target_of(0.2, 0), go_on);
  ASSERT_TRUE(found.ok());
  EXPECT_TRUE(found->met);
  EXPECT_LE(found->runs, 2u) << "beads keep their volume, slots nearly so";
  EXPECT_NEAR(found->forward.porosity, 0.2, 0.01);
  EXPECT_LE(found->forward.porosity_through, found->forward.porosity);
  EXPECT_NEAR(found->forward.pore_width_mm, found->design.pores.width_mm, 1e-3);
  EXPECT_NEAR(found->forward.pore_length_mm, found->design.pores.length_mm, 1e-3);
}

TEST(DesignedJob, WhatIsOutOfReachIsReportedWithTheNearest) {
  const auto found = pipeline::design_job(target_of(0.5, 0), go_on);
  ASSERT_TRUE(found.ok());
  EXPECT_FALSE(found->met);
  EXPECT_LE(found->runs, 2u) << "a further search finds the same";
  EXPECT_GT(found->forward.porosity, 0.24) << "the most open plan, of which no volume is left out";
  EXPECT_LT(found->forward.porosity, 0.4);
  EXPECT_FALSE(found->outside.empty());
}

TEST(DesignedJob, ItEndsOnRequest) {
  const auto found = pipeline::design_job(target_of(0.2, 0), [](double) { return false; });
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.error().fault, Fault::kInterrupted);
}

TEST(DesignedJob, TheCommandWritesAJobThatExtrudeTakes) {
  test::Directory folder;
  test::write_box(folder / "part.stl", {0, 0, 0}, {12, 12, 0.9F});
  const auto made = test::run_lamina(
      {"design", "--pore", "0.12x0.9", "--machine", "anet-a8", "--voxel", "30", "--json", "-o", "a.toml"}, folder.path());
  ASSERT_EQ(made.code, 0) << made.err;
  const nlohmann::ordered_json reported = nlohmann::ordered_json::parse(made.out);
  EXPECT_EQ(reported["met"], true);
  EXPECT_NEAR(reported["pore_mm"][0].get<double>(), 0.12, 0.002);
  const auto deposited = test::run_lamina({"extrude", "part.stl", "--job", "a.toml", "--json", "-o", "a.gcode"}, folder.path());
  ASSERT_EQ(deposited.code, 0) << deposited.err;
  const nlohmann::ordered_json summary = nlohmann::ordered_json::parse(deposited.out);
  EXPECT_TRUE(summary["warnings"].empty()) << summary["warnings"].dump();
  EXPECT_NEAR(summary["pores"][0]["width_mm"].get<double>(), 0.12, 0.002);
  EXPECT_NEAR(summary["pores"][0]["length_mm"].get<double>(), 0.9, 0.02);
}

TEST(DesignedJob, ARefusedTargetWritesNothingUnlessTheNearestIsWanted) {
  test::Directory folder;
  const std::vector<std::string> far = {"design", "--pore", "0.4x1", "--machine", "anet-a8", "--voxel", "30", "-o", "a.toml"};
  const auto refused = test::run_lamina(far, folder.path());
  EXPECT_EQ(refused.code, 5);
  EXPECT_NE(refused.err.find("not reachable: nearest is --pore 0."), std::string::npos) << refused.err;
  EXPECT_TRUE(test::files_below(folder.path()).empty());
  std::vector<std::string> nearest = far;
  nearest.push_back("--nearest");
  EXPECT_EQ(test::run_lamina(nearest, folder.path()).code, 0);
  EXPECT_EQ(test::files_below(folder.path()).size(), 1u);
}

TEST(DesignedJob, WhatIsReachableIsPrintedBeforeTheNearestToAnImpossibleTarget) {
  test::Directory folder;
  const auto far = test::run_lamina(test::words_of("design --permeability 1e5 --machine anet-a8 --voxel 30 --json -o a.toml"),
                                    folder.path());
  EXPECT_EQ(far.code, 5);
  const auto table = far.err.find("reach     lines  porosity, %"), outside = far.err.find("target    out of this reach");
  ASSERT_NE(table, std::string::npos) << far.err;
  EXPECT_LT(table, outside);
  EXPECT_LT(outside, far.err.find("along z   k1 "));
  const nlohmann::ordered_json json = nlohmann::ordered_json::parse(far.out);
  ASSERT_EQ(json["reach"].size(), 3u);
  EXPECT_NEAR(json["reach"][0]["k1_darcy"][1].get<double>() / json["k1_darcy"].get<double>(), 1, 0.2)
      << "the end is the nearest";
  EXPECT_LE(json["runs"], 4);
  EXPECT_TRUE(json["warnings"].empty()) << "its widths were measured";
  EXPECT_LT(json["k1_range_darcy"][0], 0.81 * json["k1_darcy"].get<double>());
  EXPECT_GT(json["k1_range_darcy"][1], 1.42 * json["k1_darcy"].get<double>());
}

TEST(DesignedJob, APrinterWithoutACalibrationIsWarnedOf) {
  test::Directory folder;
  const auto near =
      test::run_lamina(test::words_of("design --pore 0.12x0.9 --machine marlin --voxel 30 --json"), folder.path());
  ASSERT_EQ(near.code, 0) << near.err;
  EXPECT_NE(near.err.find("warning   Marlin has no calibration of its own"), std::string::npos) << near.err;
  EXPECT_EQ(near.err.find("target    out of this reach"), std::string::npos) << near.err;
  const nlohmann::ordered_json json = nlohmann::ordered_json::parse(near.out);
  ASSERT_EQ(json["warnings"].size(), 1u);
  EXPECT_EQ(json["warnings"][0]["code"], "calibration");
}

}  // namespace
}  // namespace lamina
