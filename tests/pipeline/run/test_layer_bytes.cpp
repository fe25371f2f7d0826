// A layer takes no more bytes than its limit, before its dose and with it, for any job; and not many fewer.
#include <gtest/gtest.h>

#include <iostream>

#include "pipeline/job/file.h"
#include "pipeline/run/layer_imager.h"
#include "stages/geometry/drop_rows.h"
#include "tests/commands/program.h"
#include "tests/pipeline/plan/plan_of.h"

namespace lamina::pipeline {
namespace {

struct TakenBytes {
  double reported = 0, used = 0;
};

TakenBytes expect_layers_take_no_more(const std::vector<std::string>& parts, const std::vector<std::string>& keys) {
  TakenBytes sum;
  Job job;
  for (const std::string& part : parts) {
    job.parts.push_back({});
    job.parts.back().path = std::string(LAMINA_TEST_DIR "/corpus/") + part;
  }
  job.layer_mm = 0.1;
  std::string reported;
  for (const std::string& key : keys) {
    const Status status = set_key(job, key);
    EXPECT_TRUE(status.ok()) << status.error().message;
    reported += " " + key;
  }
  SCOPED_TRACE(parts.front() + reported);
  const Result<Plan> plan = test::plan_of(job, Product::kImages);
  EXPECT_TRUE(plan.ok()) << plan.error().message;
  if (!plan) return sum;
  const LayerImager imager(*plan);
  for (std::uint32_t i = 0; i < plan->layer_count && !testing::Test::HasFailure(); i += 1 + plan->layer_count / 8) {
    const Layer layer = plan->layer(i);
    ImageWork work;  // of this layer alone
    LayerRecord record;
    ImageNotes notes;
    EXPECT_TRUE(imager.raster(layer, work, record, notes).ok());
    if (job.levels > 0) imager.shares(layer, work, record);
    EXPECT_TRUE(imager.images(layer, work, notes).ok());
    EXPECT_LE(work.bytes(), imager.bytes_of(layer, 0)) << "layer " << i << " before its dose";
    const std::uint64_t pixels = plan->images->dose.parted_pixels(work.runs, work.drops);
    EXPECT_EQ(pixels > 0 && !plan->images->dose.parts_pixels(), false);
    EXPECT_TRUE(imager.bleed(layer, work, notes).ok());
    EXPECT_TRUE(imager.dose(layer, work, record).ok());
    const std::uint64_t reported_bytes = imager.bytes_of(layer, pixels);
    EXPECT_LE(work.bytes(), reported_bytes) << "layer " << i;
    EXPECT_LE(reported_bytes, imager.bytes_of(layer, LayerImager::kUnknown)) << "layer " << i;
    const dose::DropBound drops = imager.drops_bound(layer, pixels);
    EXPECT_LE(work.runs.change.size(), drops.changes) << "layer " << i;
    EXPECT_LE(work.drops.levels.level.size(), drops.changes) << "layer " << i;
    std::uint64_t changes = 0;
    for (std::uint32_t drop = 0; work.drops.dosed() && drop < std::max(1u, plan->images->dose.max_drops()); ++drop) {
      Runs plane;
      runs_of(work.drops.drops[0], drop, plane);
      EXPECT_LE(plane.change.size(), drops.changes) << "layer " << i;
      changes += plane.change.size();
    }
    EXPECT_LE(changes, drops.changes_of_all) << "layer " << i;
    if (work.drops.dosed()) {
      EXPECT_LE(work.drops.drops[0].zones.level.size(), drops.runs) << "layer " << i;
    }
    sum.reported += static_cast<double>(reported_bytes), sum.used += static_cast<double>(work.bytes());
  }
  return sum;
}

constexpr const char* kCrown = "dental_crown.stl";
constexpr const char* kNut = "parameter_quality_nut.stl";
const std::string kOneDropHead = "machine.profile=jet1000", kGreyHead = "machine.profile=jet1000-grey",
                  kBed = "bed.size_mm=[60,60]";

TEST(LayerBytes, OfLevelsAreNoMoreThanWhatIsReportedAndAFifthOfItNoLessThan) {
  TakenBytes all;
  for (const char* part : {kCrown, kNut, "nist_part_feature_open.stl"}) {
    for (const char* levels : {"dose.levels=2", "dose.levels=4", "dose.levels=16"}) {
      const TakenBytes fine = expect_layers_take_no_more({part}, {kBed, "bed.dpi=900", levels});
      all.reported += fine.reported, all.used += fine.used;
      expect_layers_take_no_more({part}, {kBed, "bed.dpi=250", "layers.thickness_mm=0.3", levels});
      expect_layers_take_no_more({part}, {kBed, "bed.dpi=300", levels, "dose.dithered=false"});
      expect_layers_take_no_more({part}, {kBed, "bed.dpi=300", levels, "image.format=tiff-8"});
      expect_layers_take_no_more({part}, {kBed, "bed.dpi=300", levels, "image.mirror=xy", "dose.bleed_um=[150,100]"});
      expect_layers_take_no_more({part}, {kOneDropHead, levels, "dose.saturation_percent=170"});
      expect_layers_take_no_more({part}, {kGreyHead, levels, "dose.dithered=false"});
    }
  }
  EXPECT_LT(all.reported, 5 * all.used);
  std::cout << "reported bytes of levels: " << all.reported / all.used << " times their use\n";
}

TEST(LayerBytes, OfDropsAreNoMoreThanWhatIsReportedAndAFifthOfItNoLessThan) {
  TakenBytes all;
  for (const char* part : {kCrown, kNut, "quad_knot.obj"}) {
    for (const char* drops :
         {"dose.saturation_percent=40", "dose.saturation_percent=350", "dose.saturation_percent=40+x", "dose.core=0.4"}) {
      const TakenBytes plain = expect_layers_take_no_more({part}, {kOneDropHead, drops});
      all.reported += plain.reported, all.used += plain.used;
      expect_layers_take_no_more({part}, {kOneDropHead, drops, "dose.bleed_um=[100,100]", "image.mirror=x"});
      expect_layers_take_no_more({part}, {kOneDropHead, drops, "dose.bleed_um=[-100,-50]"});
      expect_layers_take_no_more({part}, {kOneDropHead, drops, "heights.containment=inside"});
      expect_layers_take_no_more({part}, {kGreyHead, drops, "run.engine=both"});
      if (std::string(drops).find("core") != std::string::npos) continue;
      expect_layers_take_no_more({part}, {kOneDropHead, drops, "dose.core_saturation_percent=30", "dose.shell_mm=0.5"});
      expect_layers_take_no_more({part}, {kOneDropHead, drops, "dose.dithered=false"});
      // A second part of another dose; with levels they share voxels.
      expect_layers_take_no_more({part, kCrown}, {kOneDropHead, drops, "part.saturation_percent=123"});
      expect_layers_take_no_more({part, kCrown}, {kOneDropHead, drops, "part.saturation_percent=123", "dose.levels=4"});
    }
  }
  EXPECT_LT(all.reported, 5 * all.used);
  std::cout << "reported bytes of drops: " << all.reported / all.used << " times their use\n";
}

}  // namespace
}  // namespace lamina::pipeline
