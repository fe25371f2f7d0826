// Layers that would need two powders, by heights alone.
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "pipeline/report/image_text.h"
#include "stages/checks/layer_warnings.h"

namespace lamina::checks {
namespace {

std::vector<Nm> planes_of(std::uint32_t layers) {
  std::vector<Nm> planes;
  for (std::uint32_t i = 0; i < layers; ++i) planes.push_back(static_cast<Nm>(100 * i + 50));
  return planes;
}

TEST(MixedLayers, ByHand) {
  const std::vector<Nm> planes = planes_of(10);  // 50, 150, ..., 950
  using Ranges = std::vector<LayerRange>;
  // Side by side up to 350, a plane at the top of a part is above it; then alone; then again.
  EXPECT_EQ(mixed_layers({{0, 350, 0}, {0, 1000, 1}, {700, 900, 0}}, 2, planes), (Ranges{{0, 2}, {7, 8}}));
  // One upon the other mixes nothing, nor do two parts of one powder.
  EXPECT_EQ(mixed_layers({{0, 500, 0}, {500, 1000, 1}}, 2, planes), Ranges());
  EXPECT_EQ(mixed_layers({{0, 500, 1}, {200, 1000, 1}}, 2, planes), Ranges());
  EXPECT_EQ(mixed_layers({{450, 550, 2}, {0, 1000, 0}}, 3, planes), (Ranges{{4, 4}}));
  EXPECT_EQ(mixed_layers({}, 2, planes), Ranges());
}

TEST(MixedLayers, AsCountedLayerByLayer) {
  std::mt19937 random(7);
  const std::vector<Nm> planes = planes_of(40);
  for (int round = 0; round < 200; ++round) {
    std::vector<PowderInterval> intervals(1 + random() % 8);
    for (PowderInterval& one : intervals) {
      one.from = static_cast<std::int64_t>(random() % 4000);
      one.to = one.from + static_cast<std::int64_t>(random() % 1500);
      one.material = static_cast<std::uint32_t>(random() % 3);
    }
    std::set<std::uint32_t> counted, found;
    for (std::uint32_t i = 0; i < planes.size(); ++i) {
      std::set<std::uint32_t> powders;
      for (const auto& [from, to, material] : intervals) {
        if (planes[i] >= from && planes[i] < to) powders.insert(material);
      }
      if (powders.size() > 1) counted.insert(i);
    }
    for (const auto& [first, last] : mixed_layers(intervals, 3, planes)) {
      for (std::uint32_t i = first; i <= last; ++i) found.insert(i);
    }
    EXPECT_EQ(found, counted) << round;
  }
}

TEST(MixedLayers, AreNamedShortly) {
  const auto text = [](std::vector<LayerRange> ranges) { return pipeline::ranges_text(ranges); };
  EXPECT_EQ(text({{4, 4}}), "layer 4");
  EXPECT_EQ(text({{0, 41}}), "layers 0 to 41");
  EXPECT_EQ(text({{0, 41}, {60, 60}, {72, 80}}), "layers 0 to 41, 60 and 72 to 80");
  EXPECT_EQ(text({{0, 0}, {2, 2}, {4, 4}, {6, 6}, {8, 8}, {10, 10}, {12, 12}, {14, 14}}),
            "layers 0, 2, 4, 6, 8, 10 and 2 more ranges");
}

}  // namespace
}  // namespace lamina::checks
