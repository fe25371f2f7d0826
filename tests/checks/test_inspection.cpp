// An inspection with a memory limit: it takes no more, stops at the limit, and reports its findings until then.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "pipeline/report/image_text.h"
#include "stages/checks/inspect.h"
#include "tests/checks/volume.h"

namespace lamina::checks {
namespace {

constexpr std::uint32_t kSide = 200, kLayers = 12;

/// A plate whose layers become noise, from sparse to dense.
Volume noisy_plate() {
  Volume volume{kSide, kSide, kLayers, std::vector<std::uint8_t>(std::size_t{kSide} * kSide * kLayers, 0)};
  std::mt19937 random(5);
  for (std::uint32_t l = 0; l < kLayers; ++l) {
    for (std::size_t i = 0; i < std::size_t{kSide} * kSide; ++i) {
      volume.set[std::size_t{l} * kSide * kSide + i] = random() % 1000 >= 35 * l ? 1 : 0;
    }
  }
  return volume;
}

class BoundedInspection : public testing::Test {
 protected:
  /// The findings of the first layers, each inspected in the scratch memory that layers use in sequence.
  Findings inspect(std::uint64_t max_bytes, std::uint32_t layers = kLayers, std::size_t slots = 1) {
    const std::int64_t side = 20 * kNmPerMm, up = 100'000;
    const Box box{{0, 0, 0}, {static_cast<Nm>(side), static_cast<Nm>(side), static_cast<Nm>(kLayers * up)}};
    Inspection inspection(grid_, {{box, 0}}, 300'000, 500'000, max_bytes);
    std::vector<LayerInspection> inspections(slots);
    held_.clear();
    inspected_ = 0;
    for (std::uint32_t l = 0; l < layers; ++l) {
      LayerInspection& prepared = inspections[l * 7 % slots];
      inspection.prepare(volume_.layer(l), prepared);
      inspected_ = std::max(inspected_, prepared.bytes());
      inspection.add({l, static_cast<Nm>(l * up), static_cast<Nm>(up)}, prepared);
      held_.push_back(inspection.bytes());
    }
    return inspection.finish();
  }
  static std::string reported(const Findings& findings) {
    std::vector<Warning> warnings;
    const std::string name = "plate";
    report(findings, {&name, 1}, 0.3, 0.5, warnings);
    std::string text;
    for (const Warning& warning : warnings) text += warning.code + ": " + warning.text + "\n";
    return text;
  }

  const PixelGrid grid_{PixelAxis(254, 20 * kNmPerMm), PixelAxis(254, 20 * kNmPerMm)};
  const Volume volume_ = noisy_plate();
  std::vector<std::uint64_t> held_;  // after each layer
  std::uint64_t inspected_ = 0;      // by the inspection of any layer
};

TEST_F(BoundedInspection, HoldsNoMoreThanItMayAndReportsWhatItFoundBefore) {
  const Findings all = inspect(UINT64_MAX);
  EXPECT_FALSE(all.stop);
  EXPECT_EQ(all.layers, kLayers);
  const std::uint64_t maximum = *std::ranges::max_element(held_);
  std::uint32_t last = 0;
  for (std::uint64_t may = maximum / 64; may <= 4 * maximum; may += may / 8) {
    SCOPED_TRACE(may);
    const Findings found = inspect(may);
    EXPECT_LE(*std::ranges::max_element(held_), may + may / 16) << "buffers of an earlier layer may be larger";
    EXPECT_LE(inspected_, 2 * may) << "buffers grow by halves";
    EXPECT_GE(found.layers, last) << "more memory never detects less";
    last = found.layers;
    ASSERT_EQ(found.stop.has_value(), found.layers < kLayers);
    if (!found.stop) continue;
    EXPECT_EQ(found.stop->layer, found.layers);
    EXPECT_GT(found.stop->bytes, may);
    EXPECT_EQ(held_.back(), 0u) << "it lets go";
    // Of the layers below all is known except the end of bodies that continue.
    const Findings below = inspect(UINT64_MAX, found.layers);
    EXPECT_EQ(found.islands.count, below.islands.count);
    EXPECT_EQ(found.hollows.count, below.hollows.count);
    EXPECT_EQ(found.thin.count, below.thin.count);
    EXPECT_EQ(found.thin.locations.size(), below.thin.locations.size());
    EXPECT_EQ(found.roofs.count, below.roofs.count);
    EXPECT_EQ(found.gaps.count, below.gaps.count);
    EXPECT_EQ(found.contacts.count, below.contacts.count);
    EXPECT_LE(found.loose.count, below.loose.count);
    const std::string text = reported(found);
    EXPECT_EQ(text.find(found.layers == 0 ? "not-inspected: no layer was inspected"
                                          : "not-inspected: layers from " + std::to_string(found.layers) + " on"),
              text.rfind("not-inspected"))
        << text;
    EXPECT_NE(text.find("give --memory"), std::string::npos) << text;
    EXPECT_EQ(pipeline::json_of(found, 0.3, 0.5)["stopped"]["layer"], found.layers);
  }
  EXPECT_EQ(last, kLayers);
  EXPECT_EQ(reported(all).find("not-inspected"), std::string::npos);
}

TEST_F(BoundedInspection, StopsWhereItDoesRegardlessOfTheScratchOfLayers) {
  const Findings all = inspect(UINT64_MAX);
  const std::uint64_t maximum = *std::ranges::max_element(held_);
  for (const std::uint64_t may : {maximum / 16, maximum / 4, maximum / 2, maximum}) {
    const std::string one = json_text(pipeline::json_of(inspect(may), 0.3, 0.5));
    for (const std::size_t slots : {2, 3, 5, 12})
      EXPECT_EQ(json_text(pipeline::json_of(inspect(may, kLayers, slots), 0.3, 0.5)), one) << may;
  }
}

/// The memory reported as needed is enough for that layer.
TEST_F(BoundedInspection, GetsFurtherWithWhatItRequests) {
  std::uint64_t may = 1000;
  std::uint32_t requested = 0;
  for (std::optional<std::uint32_t> stopped; requested < 40; ++requested) {
    const Findings found = inspect(may);
    if (!found.stop) break;
    EXPECT_GE(found.stop->layer, stopped.value_or(0));
    stopped = found.stop->layer;
    may = found.stop->bytes;
  }
  EXPECT_LT(requested, 40u);
}

}  // namespace
}  // namespace lamina::checks
