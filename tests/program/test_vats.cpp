// Vats of stated depth: by hand, which layer finds one empty and where a job pauses.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/report/image_text.h"
#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"
#include "stages/program/vats.h"

namespace lamina::program {
namespace {

Machine vat_machine(double first_mm, double second_mm, VatRefill refill) {
  Machine machine;
  machine.name = "deep";
  machine.powder.vats = 2;
  machine.powder.dose = 1.25;
  machine.powder.vat_depth_mm = {first_mm, second_mm};
  machine.powder.refill = refill;
  return machine;
}

/// Layers of 0.1 mm; vats that feed them, a bit each, repeated.
VatPlan planned(const Machine& machine, std::uint32_t layers, const std::vector<std::uint32_t>& feeds) {
  VatPlan vats(machine);
  for (std::uint32_t i = 0; i < layers; ++i) {
    vats.add({i, static_cast<Nm>(i * 100'000), 100'000, LayerReason::kUniform}, feeds[i % feeds.size()]);
  }
  return vats;
}

// A layer takes 0.125 mm: 2.5 mm are 20 layers; with a base of 5 x 0.2 mm, which takes 1.25 mm, 10.
TEST(Vats, ByHand) {
  Machine machine = vat_machine(2.5, 0, VatRefill::kRefuse);
  EXPECT_TRUE(planned(machine, 20, {1}).status().ok());
  const Status empty = planned(machine, 24, {1}).status();
  ASSERT_FALSE(empty.ok());
  EXPECT_EQ(empty.error().fault, Fault::kUsage);
  EXPECT_EQ(
      empty.error().message,
      "layer 20 (z 2.000 mm): the first vat of deep, 2.5 mm deep, is empty for it: the job takes 3 mm, layers x dose 1.25; "
      "make the job lower, or let it pause for vats to be filled with powder.refill = \"pause\"");
  machine.powder.base_layers = 5;
  machine.powder.base_layer_mm = 0.2;
  EXPECT_TRUE(planned(machine, 10, {1}).status().ok());
  const Status base = planned(machine, 11, {1}).status();
  ASSERT_FALSE(base.ok());
  EXPECT_NE(base.error().message.find("layer 10 (z 1.000 mm)"), std::string::npos);
  EXPECT_NE(base.error().message.find("the job takes 2.625 mm, layers x dose 1.25 with a base of 1 mm"), std::string::npos);
  machine.powder.refill = VatRefill::kPause;
  const VatPlan pauses = planned(machine, 51, {1});
  EXPECT_TRUE(pauses.status().ok());
  EXPECT_EQ(pauses.refills(), (std::vector<std::uint32_t>{10, 30, 50}));
  EXPECT_EQ(pipeline::refills_text(pauses.refills()), "pauses before layers 10, 30 and 50 for vats to be filled");
}

// Both vats half of the dose each: 0.0625 mm, written as such. In turns each takes every other layer. A pause fills both.
TEST(Vats, TwoOfThem) {
  EXPECT_TRUE(planned(vat_machine(1.25, 1.25, VatRefill::kRefuse), 20, {3}).status().ok());
  EXPECT_FALSE(planned(vat_machine(1.25, 1.25, VatRefill::kRefuse), 21, {3}).status().ok());
  const Status second = planned(vat_machine(0, 1, VatRefill::kRefuse), 20, {1, 2}).status();
  ASSERT_FALSE(second.ok());
  EXPECT_NE(second.error().message.find("layer 17 (z 1.700 mm): the second vat"), std::string::npos) << second.error().message;
  EXPECT_EQ(planned(vat_machine(0.5, 1, VatRefill::kPause), 26, {1, 2}).refills(), (std::vector<std::uint32_t>{8, 16, 24}));
}

TEST(Vats, NoDepthIsNoLimitAndALayerThatNoVatHoldsIsRefusedByEitherRule) {
  EXPECT_FALSE(VatPlan::has_depths(vat_machine(0, 0, VatRefill::kRefuse)));
  EXPECT_TRUE(planned(vat_machine(0, 0, VatRefill::kRefuse), 5000, {1, 2}).status().ok());
  Machine base = vat_machine(0.3, 0, VatRefill::kPause);
  base.powder.base_layers = 2;  // of 0.1 mm: with the first layer 0.375 mm
  EXPECT_NE(planned(base, 3, {1}).status().error().message.find("layer 0 (z 0.000 mm)"), std::string::npos);
  for (const VatRefill rule : {VatRefill::kRefuse, VatRefill::kPause}) {
    const Status small = planned(vat_machine(0.12, 0, rule), 3, {1}).status();
    ASSERT_FALSE(small.ok());
    EXPECT_NE(
        small.error().message.find("layer 0 (z 0.000 mm): the first vat of deep, 0.12 mm deep, holds less than this layer"),
        std::string::npos)
        << small.error().message;
  }
}

}  // namespace
}  // namespace lamina::program
