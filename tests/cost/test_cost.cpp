// What jobs use up and cost, by hand; shares add up.
#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "stages/cost/cost.h"
#include "stages/cost/part_pixels.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/levels.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"

namespace lamina::cost {
namespace {

/// 100 x 50 mm at 254 dpi: pixels of 0.1 mm; drops of 100 pl; dose 1.5; 36 an hour, binder 100 a litre, powder 20 a litre.
Machine printer() {
  Machine machine;
  machine.bed.size_mm = {100, 50};
  machine.head.drop_pl = 100;
  machine.powder.dose = 1.5;
  machine.cost.hour_price = 36;
  machine.cost.binder_price_l = 100;
  machine.cost.powder_price_l = 20;
  return machine;
}
PixelGrid grid() { return {PixelAxis(254, 100'000'000), PixelAxis(254, 50'000'000)}; }

TEST(Cost, OneLayerByHand) {
  const Machine machine = printer();
  Tally tally(machine, grid(), 1);
  tally.add(100'000, 10'000'000, 40'000, 40'000, {});
  const Use job = tally.quote().job;
  EXPECT_EQ(job.binder_nl, 4'000);  // 40,000 x 100 pl = 4 ul
  EXPECT_EQ(job.fed_nl, 750'000);   // 1.5 x 0.1 mm x 5,000 mm2 = 750 mm3
  EXPECT_EQ(job.bound_nl, 40'000);  // 40,000 x 0.01 mm2 x 0.1 mm = 40 mm3
  EXPECT_EQ(job.left_nl(), 710'000);
  EXPECT_EQ(job.hour_cents, 10);   // 10 s at 0.01 a second
  EXPECT_EQ(job.binder_cents, 0);  // 4e-6 l: 0.0004
  EXPECT_EQ(job.powder_cents, 2);  // 0.00075 l: 0.015, rounded to 0.02
}

TEST(Cost, PowderIsUsedAgainAndSpitsAreBinder) {
  Machine machine = printer();
  machine.cost.powder_reuse = 0.5;
  machine.cost.spit_drops = 1'000'000;
  Tally tally(machine, grid(), 1);
  for (int i = 0; i < 100; ++i) tally.add(100'000, 36'000'000, 1'000'000, 500'000, {});
  const Use job = tally.quote().job;
  EXPECT_EQ(job.binder_nl, 20'000'000);  // 100 x 2,000,000 x 100 pl = 20 ml
  EXPECT_EQ(job.fed_nl, 75'000'000);     // 75 ml
  EXPECT_EQ(job.bound_nl, 50'000'000);   // 100 x 500,000 x 0.001 mm3 = 50,000 mm3
  EXPECT_EQ(job.hour_cents, 3600);       // one hour
  EXPECT_EQ(job.binder_cents, 200);      // 0.02 l
  EXPECT_EQ(job.powder_cents, 125);      // 0.05 + 0.5 x 0.025 l = 0.0625 l
}

TEST(Cost, AKilogramAndItsDensityAreAPrice) {
  Machine machine = printer();
  machine.cost.powder_price_l = 0;
  machine.cost.powder_price_kg = 40;
  machine.cost.powder_kg_l = 4.5;
  EXPECT_EQ(powder_price_l(machine.cost), 180);
  Tally tally(machine, grid(), 1);
  tally.add(1'000'000, 0, 0, 0, {});               // 1.5 x 1 mm x 5,000 mm2 = 7.5 ml
  EXPECT_EQ(tally.quote().job.powder_cents, 135);  // 0.0075 l x 180
}

TEST(Cost, APartPaysForTheLayersInWhichItIs) {
  const Machine machine = printer();
  Tally tally(machine, grid(), 2);
  const std::uint64_t both[] = {3'000, 1'000}, high[] = {0, 2'000};
  tally.add(100'000, 8'000'000, 4'000, 4'000, both);  // 6 s and 2 s
  tally.add(100'000, 6'000'000, 2'000, 2'000, high);  // 0 s and 6 s
  tally.add(100'000, 2'000'000, 0, 0, {});            // by all pixels, 3,000 to 3,000: 1 s each
  const Quote quote = tally.quote();
  EXPECT_EQ(quote.parts[0].microseconds, 7'000'000);
  EXPECT_EQ(quote.parts[1].microseconds, 9'000'000);
  EXPECT_EQ(quote.parts[0].fed_nl, 937'500);  // 750,000 x 3/4 + 0 + 375,000
  EXPECT_EQ(quote.parts[1].fed_nl, 1'312'500);
  EXPECT_EQ(quote.parts[0].binder_nl, 300);  // 6,000 drops are 600 nl
  EXPECT_EQ(quote.parts[0].bound_nl, 3'000);
  EXPECT_EQ(quote.parts[0].hour_cents, 7);  // 16 s are 0.16
  EXPECT_EQ(quote.parts[1].hour_cents, 9);
}

TEST(Cost, WhatPartsHaveAddsUpToTheJob) {
  std::mt19937 random(3);
  const Machine machine = printer();
  for (int round = 0; round < 50; ++round) {
    const std::size_t parts = 1 + random() % 6;
    Tally tally(machine, grid(), parts);
    for (int layer = 0; layer < 20; ++layer) {
      std::vector<std::uint64_t> pixels(parts);
      for (std::uint64_t& one : pixels) one = random() % 3 == 0 ? 0 : random() % 100'000;
      const std::uint64_t all = std::accumulate(pixels.begin(), pixels.end(), std::uint64_t{0});
      tally.add(50'000 + static_cast<std::int64_t>(random() % 50'000), static_cast<std::int64_t>(random() % 20'000'000), all,
                all, pixels);
    }
    const Quote quote = tally.quote();
    Use sum;
    for (const Use& part : quote.parts) {
      sum.pixels += part.pixels, sum.drops += part.drops, sum.microseconds += part.microseconds,
          sum.binder_nl += part.binder_nl;
      sum.fed_nl += part.fed_nl, sum.bound_nl += part.bound_nl, sum.hour_cents += part.hour_cents;
      sum.binder_cents += part.binder_cents, sum.powder_cents += part.powder_cents;
    }
    EXPECT_EQ(sum, quote.job) << round;
  }
}

TEST(Cost, SharesByTheLargestRemainder) {
  const std::uint64_t weights[] = {1, 1, 1}, none[] = {0, 0}, votes[] = {47, 16, 15, 9, 8, 5};
  EXPECT_EQ(shares(10, weights), (std::vector<std::int64_t>{4, 3, 3}));
  EXPECT_EQ(shares(5, none), (std::vector<std::int64_t>{3, 2}));
  EXPECT_EQ(shares(10, votes), (std::vector<std::int64_t>{5, 2, 1, 1, 1, 0}));  // quotas 4.7, 1.6, 1.5, 0.9, 0.8, 0.5
}

TEST(Cost, PixelsOfPartsApartAreExactAndOthersShareTheirs) {
  const auto box = [](int x, int y, int w, int d) {
    const auto nm = [](int mm) { return mm * 1'000'000; };
    return Box{{nm(x), nm(y), 0}, {nm(x + w), nm(y + d), nm(1)}};
  };
  const PixelGrid bed{PixelAxis(254, 4'000'000), PixelAxis(254, 2'000'000)};  // 40 x 20 pixels
  Runs runs;
  runs.columns = 40;
  runs.row_offset.push_back(0);
  for (int r = 0; r < 20; ++r) {  // rows 0 to 9 lie at the back: 10 pixels in x 0..1 mm; all rows: 20 in x 2..4 mm
    if (r < 10) runs.change.insert(runs.change.end(), {0, 10});
    runs.change.insert(runs.change.end(), {20, 40});
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  const Layer layer{0, 0, 500'000};
  using Pixels = std::vector<std::uint64_t>;
  const Body apart[] = {{box(0, 1, 1, 1), 0, 0}, {box(2, 0, 2, 2), 1, 1}};
  EXPECT_EQ(PartPixels(apart, 2, bed, false, false).count(layer, runs), (Pixels{100, 400}));
  // Mirrored from left to right the first window sees 10 rows of 10 columns on the right, the second all on the left.
  EXPECT_EQ(PartPixels(apart, 2, bed, true, false).count(layer, runs), (Pixels{100, 100}));
  // In one group: 500 pixels by windows of 100 and 400; a part above the layer has none.
  Body touching[] = {{box(0, 1, 1, 1), 0, 0}, {box(2, 0, 2, 2), 1, 0}};
  EXPECT_EQ(PartPixels(touching, 2, bed, false, false).count(layer, runs), (Pixels{100, 400}));
  // Drops: two a pixel where the columns are below 10, three beyond them; levels may touch within a row.
  Levels drops;
  drops.start(40);
  for (int r = 0; r < 20; ++r) {
    if (r < 10) drops.append(0, 10, 2);
    drops.append(20, 30, 3), drops.append(30, 40, 1);
    drops.end_row();
  }
  EXPECT_EQ(PartPixels(apart, 2, bed, false, false).sum(layer, drops), (Pixels{200, 800}));
  EXPECT_EQ(PartPixels(apart, 2, bed, false, false).count(layer, drops), (Pixels{100, 400}));
  EXPECT_EQ(PartPixels(apart, 2, bed, true, false).sum(layer, drops), (Pixels{100, 200}));
  // Levels of three for a full voxel: 100 pixels of two are 67, 200 of three in the core and 100 of one are 233, 300 in all.
  Levels voxels;
  voxels.start(40);
  for (int r = 0; r < 20; ++r) {
    if (r < 10) voxels.append(0, 10, 2);
    if (r < 20) voxels.append(20, 30, 6), voxels.append(30, 40, 1);
    voxels.end_row();
  }
  EXPECT_EQ(PartPixels(apart, 2, bed, false, false).share(layer, voxels, 3, 333), (Pixels{67, 266}));
  touching[0].box.lo.z = 600'000;
  EXPECT_EQ(PartPixels(touching, 2, bed, false, false).count(layer, runs), (Pixels{0, 500}));
}

}  // namespace
}  // namespace lamina::cost
