// Parts filled by beads in the bitmaps of a powder job: the whole program, and its plan against exact areas.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <polyclipping/clipper.hpp>

#include "pipeline/plan/segment.h"
#include "stages/dose/edges.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/combine.h"
#include "stages/raster/raster.h"
#include "stages/segment/cut.h"
#include "tests/commands/program.h"
#include "tests/pipeline/plan/plan_of.h"
#include "tests/segment/cylinder.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;
using test::run_lamina;

const std::string kCrown = std::string(LAMINA_TEST_DIR) + "/corpus/dental_crown.stl";

std::uint64_t outside(const RunsView& image, const RunsView& of) {
  Runs rest;
  combine(image, of, SetOperation::kDifference, rest);
  return set_pixels(rest);
}

class PorousJob : public testing::Test {
 protected:
  std::vector<Runs> layers(const std::string& name) {
    std::vector<Runs> images;
    for (std::uint32_t i = 0;; ++i) {
      const std::string file =
          folder / (name + "/layers/" + std::string(6 - std::to_string(i).size(), '0') + std::to_string(i) + ".pbm");
      if (!fs::exists(file)) return images;
      auto image = formats::image(file);
      EXPECT_TRUE(image.ok()) << (image.ok() ? "" : image.error().message);
      images.push_back(std::move(image->runs));
    }
  }
  nlohmann::json jet(const std::string& name, std::vector<std::string> more) {
    std::vector<std::string> arguments{"jet", kCrown,     "--bed", "16x16",  "--dpi",   "600x508", "--layer",
                                       "0.4", "--format", "pbm",   "--json", "--quiet", "-o",      folder / name};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const test::Outcome outcome = run_lamina(arguments, folder.path());
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out, nullptr, false);
  }
  test::Directory folder;
};

TEST_F(PorousJob, EveryFillingStaysInsideOfTheExactBitmapAndNoEngineOrThreadChangesIt) {
  jet("solid", {});
  const auto solid = layers("solid");
  ASSERT_GT(solid.size(), 10);
  const std::vector<std::vector<std::string>> fillings{
      {"--fill", "segmented", "--thin", "1", "--thick", "0.6", "--bead", "0.3"},
      {"--fill", "segmented", "--bead-ends", "square", "--walls", "1", "--angle-step", "60", "--bead", "0.3"},
      {"--fill", "segmented", "--pattern", "contour", "--thin", "1", "--thick", "0.5", "--bead", "0.3"},
      {"--fill", "raster", "--bead-gap", "0.3"},
      {"--fill", "contour", "--bead-gap", "0.2", "--bead", "0.25"},
      {"--fill", "contour+raster", "--walls", "1", "--bead-gap", "0.4"},
      {"--fill", "honeycomb", "--bead", "0.2"},
      {"--fill", "quatrefoil", "--bead", "0.2", "--bead-gap", "0.3"}};
  for (std::size_t i = 0; i < fillings.size(); ++i) {
    const std::string name = "fill" + std::to_string(i);
    auto arguments = fillings[i];
    const auto json = jet(name, arguments);
    EXPECT_GT(json["porosity"], 0.05) << name;
    EXPECT_LT(json["porosity"], 0.9) << name;
    const auto porous = layers(name);
    ASSERT_EQ(porous.size(), solid.size());
    for (std::size_t k = 0; k < porous.size(); ++k) ASSERT_EQ(outside(porous[k], solid[k]), 0) << name << " layer " << k;
    const auto same = [&](std::vector<std::string> more) {
      more.insert(more.end(), arguments.begin(), arguments.end());
      jet("again", more);
      EXPECT_EQ(test::tree_text(folder / "again"), test::tree_text(folder / name)) << name;
      fs::remove_all(folder / "again");
    };
    same({"--engine", "both", "--threads", "1"});
    if (i < 3) same({"--engine", "contours", "--threads", "4", "--memory", "1M"});
    EXPECT_EQ(run_lamina({"verify", folder / name, "--quiet"}, folder.path()).code, 0);
  }
}

TEST_F(PorousJob, AShellIsSolidAndBelowItAreTheBeads) {
  const std::vector<std::string> filling{"--fill", "raster", "--bead-gap", "0.4"};
  jet("solid", {});
  jet("beads", filling);
  auto arguments = filling;
  arguments.insert(arguments.end(), {"--shell", "0.5"});
  jet("shell", arguments);
  const auto solid = layers("solid"), beads = layers("beads"), shell = layers("shell");
  const PixelGrid grid{PixelAxis(600, 16'000'000), PixelAxis(508, 16'000'000)};
  const dose::Reach reach = dose::reach_of(grid, 500'000, 500'000);
  for (std::size_t i = 0; i < solid.size(); ++i) {
    Runs inner, rim, expected;
    dose::erode(solid[i], reach, inner);
    combine(solid[i], inner, SetOperation::kDifference, rim);
    combine(rim, beads[i], SetOperation::kUnion, expected);
    EXPECT_EQ(expected.change, shell[i].change) << "layer " << i;
    EXPECT_EQ(expected.row_offset, shell[i].row_offset) << "layer " << i;
  }
}

TEST_F(PorousJob, ResumedJobsAndShardsHaveTheBytesOfWholeOnesAndOtherFillingsAreRefused) {
  const std::vector<std::string> filling{"--fill", "segmented", "--bead", "0.3", "--machine", "nuferbj", "--layer", "1"};
  const auto run = [&](const std::string& name, std::vector<std::string> more) {
    std::vector<std::string> arguments{"jet", kCrown, "-o", folder / name, "--quiet"};
    arguments.insert(arguments.end(), filling.begin(), filling.end());
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_lamina(arguments, folder.path());
  };
  ASSERT_EQ(run("whole", {}).code, 0);
  EXPECT_EQ(run_lamina({"verify", folder / "whole", "--quiet"}, folder.path()).code, 0);
  ASSERT_EQ(run("resumed", {}).code, 0);
  fs::remove(folder / "resumed/layers/000003.tif");
  EXPECT_EQ(run("resumed", {"--thin", "1", "--resume"}).code, 2);
  ASSERT_EQ(run("resumed", {"--resume"}).code, 0);
  EXPECT_EQ(test::tree_text(folder / "resumed"), test::tree_text(folder / "whole"));
  for (const char* shard : {"3/3", "1/3", "2/3"}) ASSERT_EQ(run("shards", {"--shard", shard}).code, 0);
  ASSERT_EQ(run_lamina({"merge", folder / "shards", "-o", folder / "shards", "--quiet"}, folder.path()).code, 0);
  EXPECT_EQ(test::tree_text(folder / "shards"), test::tree_text(folder / "whole"));
  // From directories of their own, and with another filling in one of them.
  for (const char* shard : {"1/2", "2/2"}) ASSERT_EQ(run(std::string("half") + shard[0], {"--shard", shard}).code, 0);
  ASSERT_EQ(run_lamina({"merge", folder / "half1", folder / "half2", "-o", folder / "merged", "--quiet"}, folder.path()).code,
            0);
  EXPECT_EQ(test::tree_text(folder / "merged"), test::tree_text(folder / "whole"));
  ASSERT_EQ(run("other", {"--shard", "2/2", "--thin", "1"}).code, 0);
  const test::Outcome mixed =
      run_lamina({"merge", folder / "half1", folder / "other", "-o", folder / "mixed", "--quiet"}, folder.path());
  EXPECT_NE(mixed.code, 0);
  EXPECT_EQ(mixed.error_lines(), 1) << mixed.err;
  EXPECT_NE(mixed.err.find("another job"), std::string::npos) << mixed.err;
}

TEST_F(PorousJob, WhatHasNoMeaningTogetherIsOneLine) {
  const auto message = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments{"jet", kCrown, "-o", folder / "x", "--quiet", "--fill", "raster"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const test::Outcome outcome = run_lamina(arguments, folder.path());
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.err;
    return outcome.err;
  };
  EXPECT_NE(message({"--core", "0.5"}).find("dose.core: "), std::string::npos);
  EXPECT_NE(message({"--containment", "inside"}).find("--containment: "), std::string::npos);
  EXPECT_NE(message({"--fill", "rastr"}).find("raster"), std::string::npos);
  EXPECT_NE(message({"--pattern", "contour"}).find("--fill: raster, but --pattern contour"), std::string::npos);
  EXPECT_NE(
      message({"--bead-gap", "0.2", "--line-distance", "0.5"}).find("(--line-distance) and fill.gap_mm (--bead-gap) both"),
      std::string::npos);
  EXPECT_NE(message({"--fill", "segmented", "--thin-width", "0.5"}).find("segment.spacing_sc_mm"), std::string::npos);
}

TEST_F(PorousJob, PorosityOfTheBitmapIsThatOfThePlanWithinThePixelsOfItsEdges) {
  namespace cl = ClipperLib;
  pipeline::Job job;
  test::write_cylinder(folder / "cylinder.stl", 15, 1);
  job.parts = {{.path = folder / "cylinder.stl"}};
  job.bed_mm = {16, 16};
  job.dpi = {1200, 1200};
  job.layer_mm = 0.5;
  job.dry_run = true;
  job.fill.all.width_mm = 0.4;
  job.fill.all.angle_deg = 30;
  job.fill.all.angle_step_deg = 75;
  job.segment.all.on = true;
  job.segment.all.thin_width_mm = 0.15;
  const PixelGrid grid = pipeline::resolve_powder_printer(job)->grid;
  for (const auto& [bead_ends, pattern] : {std::pair{raster::BeadEnds::kRound, infill::Pattern::kRaster},
                                           {raster::BeadEnds::kSquare, infill::Pattern::kRaster},
                                           {raster::BeadEnds::kRound, infill::Pattern::kContour}}) {
    const raster::BeadEnds ends = bead_ends;
    job.dose.bead_ends = ends;
    job.fill.all.pattern = pattern;
    job.fill.all.walls = ends == raster::BeadEnds::kRound ? 1 : 0;
    auto plan = test::plan_of(job, Product::kImages);
    ASSERT_TRUE(plan.ok()) << plan.error().message;
    pipeline::Scene scene = *plan->scene;
    auto rasterizer = raster::Rasterizer::build(scene.meshes, scene.instances, grid, FillRule::kNonzero, false, true);
    ASSERT_TRUE(rasterizer.ok());
    for (const pipeline::ScheduledLayer& scheduled : plan->sections->layers()) {
      const Layer& layer = scheduled.layer;
      Runs image, scratch;
      raster::LayerScratch raster_scratch;
      rasterizer->layer(raster::Engine::kContours, layer.plane(), raster_scratch, image);
      const auto solid = set_pixels(image);
      const pipeline::Beads& beads = *plan->images->beads;
      const auto work = std::make_unique<pipeline::BeadWork>(grid, pipeline::Job().isa);
      ASSERT_TRUE(plan->sections->layer(layer.index, work->sections).ok());
      ASSERT_TRUE(beads.deposit(layer, *work).ok());
      beads.apply(image, scratch, *work);
      const auto bytes = work->bytes();
      EXPECT_LE(bytes, beads.bytes_expected(layer.index));

      // The same beads as polygons: their union within the contours, by an independent library.
      pipeline::FillRequest fill = job.fill;
      pipeline::SegmentRequest request = job.segment;
      request.all.thick_width_mm = request.all.continuous_width_mm = 0.4;
      const auto segments = pipeline::plan_segments(request, segment::Calibration(), fill);
      ASSERT_TRUE(segments.ok());
      const auto& capacity = plan->sections->areas().at(0);
      const auto cut = pipeline::layer_cut(segments->base, plan->sections->filling(capacity, layer), layer, capacity.box);
      ASSERT_TRUE(cut.ok());
      cl::Clipper clipper;
      int thin = 0;
      segment::for_each_interval(work->sections.paths, *cut, [&](const PathInterval& s) {
        const double w = s.thickness == Thickness::kThin ? 75e3 : 200e3;
        thin += s.thickness == Thickness::kThin ? 1 : 0;
        const double dx = s.to.x - s.from.x, dy = s.to.y - s.from.y, length = std::hypot(dx, dy), ux = dx / length,
                     uy = dy / length;
        cl::Path path;
        const auto at = [&](double x, double y) { path.emplace_back(std::llround(x), std::llround(y)); };
        const double first = std::atan2(uy, ux) - std::numbers::pi / 2;
        const int steps = ends == raster::BeadEnds::kRound ? 30 : 1;
        for (const auto& [centre, from] : {std::pair{s.to, first}, {s.from, first + std::numbers::pi}}) {
          for (int i = 0; i <= steps; ++i) {
            const double a = from + std::numbers::pi * i / steps;
            at(centre.x + w * std::cos(a), centre.y + w * std::sin(a));
          }
        }
        clipper.AddPath(path, cl::ptSubject, true);
        if (ends == raster::BeadEnds::kSquare && s.kind == PathKind::kLink) {
          for (const Point2 centre : {s.from, s.to}) {  // joints of links are round
            cl::Path disc;
            for (int i = 0; i < 60; ++i)
              disc.emplace_back(std::llround(centre.x + 200e3 * std::cos(i * std::numbers::pi / 30)),
                                std::llround(centre.y + 200e3 * std::sin(i * std::numbers::pi / 30)));
            clipper.AddPath(disc, cl::ptSubject, true);
          }
        }
      });
      EXPECT_GT(thin, 30);
      cl::Path outline;
      for (const Point2 p : work->sections.contours.contours.point) outline.emplace_back(p.x, p.y);
      clipper.AddPath(outline, cl::ptClip, true);
      cl::Paths merged;
      ASSERT_TRUE(clipper.Execute(cl::ctIntersection, merged, cl::pftNonZero, cl::pftNonZero));
      const double pixel = 25.4e6 / 1200;
      double area = 0, edge = 0;
      for (const cl::Path& path : merged) {
        area += cl::Area(path);
        edge += 1;
        for (std::size_t i = 0; i < path.size(); ++i) {
          const auto& p = path[i];
          const auto& q = path[(i + 1) % path.size()];
          edge += (std::abs(static_cast<double>(q.X - p.X)) + std::abs(static_cast<double>(q.Y - p.Y))) / pixel;
        }
      }
      const double planned = area / (pixel * pixel), set = static_cast<double>(set_pixels(image));
      EXPECT_LT(std::abs(set - planned), edge);
      // Errors of edge pixels have no preferred sign: together they are far smaller than that.
      const double whole = cl::Area(outline) / (pixel * pixel);
      EXPECT_NEAR(1 - set / static_cast<double>(solid), 1 - planned / whole, 0.001)
          << (ends == raster::BeadEnds::kRound ? "round" : "square");
    }
  }
}

}  // namespace
}  // namespace lamina
