#include "stages/program/compile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <sstream>

#include "stages/geometry/drop_rows.h"
#include "tests/program/machines.h"

namespace lamina::program {
namespace {

using testing::Image;
using testing::random_image;
using testing::runs_of;
using testing::SlowHead;
using testing::small_machine;

const Image kFigure = {{1, 0, 0, 1}, {0, 1, 0, 1}, {1, 1, 0, 0}, {0, 0, 1, 0}};

struct Fired {
  Sweep sweep;
  std::uint32_t step;
  std::string bits;
};

std::vector<Fired> vectors_of(const HeadGrid& grid, const Image& image, ProgramCount* count = nullptr) {
  std::vector<Fired> all;
  CompileScratch scratch;
  const Runs runs = runs_of(image);
  const auto result = compile(grid, runs, scratch, [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
    for (std::uint32_t s = 0; s < vectors.steps; ++s) {
      std::string bits;
      for (std::uint32_t i = 0; i < grid.nozzles; ++i)
        bits += (vectors.bits[s * vectors.words + i / 64] >> i % 64 & 1) != 0 ? '1' : '0';
      all.push_back({sweep, vectors.first_step + s, bits});
    }
    return {};
  });
  EXPECT_TRUE(result.ok());
  if (count != nullptr) *count = *result;
  return all;
}

HeadGrid grid_of(const Machine& machine) {
  const auto grid = make_head_grid(machine);
  EXPECT_TRUE(grid.ok()) << (grid.ok() ? "" : grid.error().message);
  return *grid;
}

TEST(TiltedHead, FourNozzlesAtFortyFiveDegreesGiveTheVectorsOfTheArticle) {
  const HeadGrid grid = grid_of(small_machine(4, 45, 4, 4));
  ASSERT_EQ(grid.positions, 4u);
  ASSERT_EQ(grid.lines, 4u);
  EXPECT_EQ(grid.lag, (std::vector<std::uint32_t>{0, 1, 2, 3}));
  EXPECT_EQ(grid.steps(), 7u);
  std::map<std::uint32_t, std::string> fired;
  for (const Fired& one : vectors_of(grid, kFigure)) fired[one.step] = one.bits;
  std::ifstream file(std::string(LAMINA_TEST_DIR) + "/reference/puppi2021/vectors_4x4.tsv");
  ASSERT_TRUE(file);
  std::string line;
  int rows = 0;
  while (std::getline(file, line)) {
    if (line.empty() || line[0] == '#' || line[0] == 's') continue;
    std::istringstream fields(line);
    std::int64_t step = 0, control[4];
    int bit[4];
    fields >> step;
    for (auto& c : control) fields >> c;
    for (auto& b : bit) fields >> b;
    ASSERT_FALSE(fields.fail());
    const auto s = static_cast<std::uint32_t>(step);
    std::string expected;
    for (const int b : bit) expected += static_cast<char>('0' + b);
    EXPECT_EQ(fired.contains(s) ? fired[s] : "0000", expected) << "step " << step;
    for (std::uint32_t i = 0; i < 4; ++i) EXPECT_EQ(step - std::int64_t{grid.lag[i]}, control[i]);
    ++rows;
  }
  EXPECT_EQ(rows, 7);
}

TEST(TiltedHead, ASecondBandUsesOnlyTheNozzlesThatAreOverTheImage) {
  Image tall = kFigure;
  tall.push_back({1, 1, 1, 1});
  tall.push_back({0, 1, 1, 0});
  const HeadGrid grid = grid_of(small_machine(4, 45, 4, 6));
  EXPECT_EQ(grid.swaths(0), 2u);
  std::vector<std::string> second;
  for (const Fired& one : vectors_of(grid, tall)) {
    if (one.sweep.swath == 1) second.push_back(one.bits);
  }
  EXPECT_EQ(second, (std::vector<std::string>{"1000", "1000", "1100", "1100"}));  // steps 0 to 3; step 4 is zero
}

TEST(TiltedHead, EquationOneAtThirtyOneDegreesScansColumnsFromTheFront) {
  Machine machine = small_machine(4, 31, 1, 1);
  machine.mounting.scan_axis = ScanAxis::kY;
  machine.mounting.scan_from = Side::kFront;
  machine.mounting.nozzle_0 = Side::kLeft;
  const double pixel = 137.1e-3 * std::cos(31 * 3.14159265358979 / 180);
  machine.bed.size_mm = {4 * pixel - 1e-4, 4 * pixel - 1e-4};
  const HeadGrid grid = grid_of(machine);
  EXPECT_EQ(grid.lag, (std::vector<std::uint32_t>{0, 1, 1, 2}));
  // Row 0 of the model is the lowest, so it is the last row here.
  const Image image = {kFigure[3], kFigure[2], kFigure[1], kFigure[0]};
  std::map<std::uint32_t, std::string> fired;
  for (const Fired& one : vectors_of(grid, image)) fired[one.step] = one.bits;
  const std::vector<std::string> model = {"1000", "0000", "1101", "0101", "0010", "0000"};
  for (std::uint32_t b = 0; b < model.size(); ++b) {
    EXPECT_EQ(fired.contains(b) ? fired[b] : "0000", model[b]) << "b " << b;
  }
  machine.head.nozzles = 128;
  EXPECT_EQ(grid_of(machine).max_lag, 76u);
  EXPECT_NEAR(grid_of(machine).lag_pixels, std::tan(31 * 3.14159265358979 / 180), 1e-6);
}

TEST(TiltedHead, ThirtyOneDegreesAgainstTheScanIsThreeHundredAndSixtyDpi) {
  Machine machine = small_machine(128, 31, 100, 100);
  const HeadGrid grid = grid_of(machine);
  EXPECT_NEAR(25.4e6 / grid.line_nm, 359.7, 0.05);
  EXPECT_NEAR(grid.lag_pixels, 1.664, 0.0005);
  const std::vector<std::uint32_t> first(grid.lag.begin(), grid.lag.begin() + 6);
  EXPECT_EQ(first, (std::vector<std::uint32_t>{0, 2, 3, 5, 7, 8}));
  machine.mounting.dpi = 360;
  EXPECT_NEAR(grid_of(machine).angle_deg, 30.97, 0.01);
  EXPECT_NEAR(grid_of(machine).lag_pixels, 5.0 / 3, 0.002);
}

TEST(TiltedHead, FortyFiveDegreesByTheGeneralRuleIsTheSpecialCaseForAllNozzles) {
  for (const auto axis : {ScanAxis::kX, ScanAxis::kY}) {
    Machine machine = small_machine(128, 45, 300, 300);
    machine.mounting.scan_axis = axis;
    machine.mounting.scan_from = axis == ScanAxis::kX ? Side::kLeft : Side::kFront;
    machine.mounting.nozzle_0 = axis == ScanAxis::kX ? Side::kBack : Side::kLeft;
    const HeadGrid grid = grid_of(machine);
    for (std::uint32_t i = 0; i < 128; ++i) EXPECT_EQ(grid.lag[i], i);
    EXPECT_EQ(grid.steps(), grid.positions + 127u);
    EXPECT_NEAR(25.4e6 / grid.line_nm, 262.0, 0.05);
  }
}

/// Random mountings, images, overlaps, passes and blocked nozzles, fired drop by drop.
class RandomMachine {
 public:
  explicit RandomMachine(std::uint32_t seed) : random(seed) {
    const double tilts[] = {90, 45, 31, 59, 75.5, 120, 150, 90};
    const std::uint32_t nozzles = 1 + random() % 150;
    machine = small_machine(nozzles, 90, 20 + random() % 300, 10 + random() % 300);
    machine.mounting.tilt_deg = tilts[random() % 8];
    machine.mounting.scan_axis = random() % 2 ? ScanAxis::kX : ScanAxis::kY;
    const bool x = machine.mounting.scan_axis == ScanAxis::kX;
    if (!x) machine.mounting.tilt_deg = 90 - machine.mounting.tilt_deg;
    machine.mounting.scan_from = x ? (random() % 2 ? Side::kLeft : Side::kRight) : (random() % 2 ? Side::kFront : Side::kBack);
    machine.mounting.nozzle_0 = x ? (random() % 2 ? Side::kBack : Side::kFront) : (random() % 2 ? Side::kLeft : Side::kRight);
    machine.mounting.first_leads = random() % 2;
    machine.mounting.passes = 1 + random() % 3;
    machine.mounting.overlap_lines = random() % 2 ? random() % (nozzles * machine.mounting.passes / 2 + 1) : 0;
    machine.mounting.first_swath = random() % 2 ? FirstSwath::kBed : FirstSwath::kLayer;
    machine.motion.both_directions = random() % 2;
    if (random() % 3 == 0) {
      machine.motion.encoder_dpi = 1468;
      machine.motion.ticks_per_pixel = 1 + random() % 5;
      machine.motion.lag_unit = random() % 2 ? LagUnit::kTick : LagUnit::kPixel;
    }
    if (random() % 3 == 0 && machine.mounting.tilt_deg == 90 && x) machine.head.row_offset_um = {0, 400.5, 137};
    machine.mounting.joint_shift_lines = random() % 2 ? random() % 200 : 0;
  }
  testing::Random random;
  Machine machine;
};

TEST(Compile, EverySetPixelIsFiredOnceAndNoOtherRegardlessOfTheMounting) {
  for (std::uint32_t seed = 0; seed < 300; ++seed) {
    RandomMachine setup(seed);
    const HeadGrid grid = grid_of(setup.machine);
    const Image image = random_image(setup.random, grid.image.columns(), grid.image.rows());
    const Runs runs = runs_of(image);
    SlowHead head(setup.machine, grid);
    CompileScratch scratch;
    std::uint32_t emitted = 0;
    const auto count = compile(
        grid, runs, scratch,
        [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
          ++emitted;
          const std::int64_t stride = grid.swath_lines() - grid.overlap,
                             first = sweep.first_line - sweep.pass - sweep.swath * stride;
          EXPECT_EQ(sweep.of, grid.swaths(first) * grid.passes);
          if (setup.machine.mounting.first_swath == FirstSwath::kBed) {
            EXPECT_EQ(-first, seed * setup.machine.mounting.joint_shift_lines % stride);
          }
          head.sweep(sweep, vectors);
          return {};
        },
        seed);
    ASSERT_TRUE(count.ok());
    ASSERT_EQ(head.fired, image) << "seed " << seed;
    EXPECT_EQ(head.outside, 0u);
    EXPECT_EQ(head.drops, set_pixels(runs));
    EXPECT_EQ(count->drops, head.drops);
    EXPECT_EQ(count->sweeps - count->skipped, emitted);
    EXPECT_EQ(count->moved + count->lost, 0u);
  }
}

// A full bed, swaths of 20 lines that share 8: of line k of them the upper swath fires (8 - k) / 9 of each 64 places, evenly
// spread, the lower one the others.
TEST(Compile, StitchesFadeFromOneSwathToTheNext) {
  Machine machine = small_machine(20, 90, 640, 32);
  machine.mounting.overlap_lines = 8;
  for (const std::uint32_t shift : {0u, 5u}) {
    machine.mounting.joint_shift_lines = shift;
    const HeadGrid grid = grid_of(machine);
    const Runs runs = runs_of(Image(grid.image.rows(), std::vector<int>(grid.image.columns(), 1)));
    CompileScratch scratch;
    std::vector<std::vector<std::uint32_t>> positions(grid.lines);  // of the upper swath, by line
    const std::uint32_t layer = 1;
    const auto count = compile(
        grid, runs, scratch,
        [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
          for (std::uint32_t s = vectors.first_step; sweep.swath == 0 && s < vectors.first_step + vectors.steps; ++s) {
            for (std::uint32_t i = 0; i < grid.nozzles; ++i) {
              if ((vectors.step(s)[0] >> i & 1) != 0) positions[static_cast<std::size_t>(sweep.first_line + i)].push_back(s);
            }
          }
          return {};
        },
        layer);
    ASSERT_TRUE(count.ok());
    EXPECT_EQ(count->drops, set_pixels(runs));
    for (std::uint32_t k = 0; k < 8; ++k) {
      const auto& own = positions[12 + k - shift];
      const std::uint32_t share = (8 - k) * 64 / 9;
      ASSERT_EQ(own.size(), grid.positions / 64 * share) << k;
      for (std::size_t i = 1; i < own.size(); ++i) EXPECT_LE(own[i] - own[i - 1], 2 * (64 / share) + 1) << k;
    }
    EXPECT_EQ(positions[11 - shift].size(), grid.positions);
    EXPECT_TRUE(positions[20 - shift].empty());
  }
}

TEST(Compile, BothDirectionsToVectorsGiveTheSameBits) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    RandomMachine setup(seed);
    const HeadGrid grid = grid_of(setup.machine);
    FireScratch scratch;
    std::vector<Buffer<std::uint32_t>> positions(grid.nozzles);
    std::vector<ColumnChanges> lines;
    for (auto& line : positions) {
      const unsigned rarity = 1 + setup.random() % 40;
      for (std::uint32_t p = 0; p <= grid.positions; ++p) {
        if (setup.random() % rarity == 0) line.push_back(p);
      }
      if (line.size() % 2) line.pop_back();
      if (setup.random() % 4 == 0) line.clear();
      lines.emplace_back(line);
    }
    SweepVectors changes, blocks;
    ASSERT_EQ(fire(grid, lines, scratch, changes, FireWay::kChanges), fire(grid, lines, scratch, blocks, FireWay::kBlocks));
    ASSERT_EQ(changes.first_step, blocks.first_step);
    ASSERT_EQ(changes.bits, blocks.bits) << "seed " << seed;
  }
}

TEST(Compile, WithBlockedNozzlesTheDifferenceIsExactlyWhatIsReported) {
  for (std::uint32_t seed = 0; seed < 300; ++seed) {
    RandomMachine setup(1000 + seed);
    auto& head_profile = setup.machine.head;
    if (head_profile.nozzles < 2) continue;
    for (unsigned i = 0; i < 1 + setup.random() % 6 && head_profile.blocked.size() + 1 < head_profile.nozzles; ++i) {
      head_profile.blocked.push_back(setup.random() % head_profile.nozzles);
    }
    const auto rule = static_cast<BlockedRule>(seed % 3);
    head_profile.blocked_rule = rule;
    const HeadGrid grid = grid_of(setup.machine);
    const Image image = random_image(setup.random, grid.image.columns(), grid.image.rows());
    const Runs runs = runs_of(image);
    SlowHead head(setup.machine, grid);
    CompileScratch scratch;
    const auto count = compile(
        grid, runs, scratch,
        [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
          head.sweep(sweep, vectors);
          return {};
        },
        seed);
    ASSERT_TRUE(count.ok());
    std::uint64_t missing = 0, added = 0, twice = 0;
    for (std::size_t r = 0; r < image.size(); ++r) {
      for (std::size_t c = 0; c < image[r].size(); ++c) {
        missing += image[r][c] > head.fired[r][c];
        added += head.fired[r][c] == 1 && image[r][c] == 0;
        twice += head.fired[r][c] > 1;
      }
    }
    EXPECT_EQ(head.blocked_drops, 0u) << "seed " << seed;
    EXPECT_EQ(twice, 0u) << "seed " << seed;
    EXPECT_EQ(head.outside, 0u);
    EXPECT_EQ(added, count->moved) << "seed " << seed;
    EXPECT_EQ(missing, count->moved + count->lost) << "seed " << seed;
    if (rule == BlockedRule::kReport) {
      EXPECT_EQ(added, 0u);
    }
    if (rule == BlockedRule::kSecondPass) {
      EXPECT_EQ(missing, 0u) << "seed " << seed;
    }
  }
}

/// Random zones of whole drops, of tiles and of a core.
struct RandomDrops {
  Levels zones;
  DropPatterns patterns;
  std::vector<std::vector<int>> drops;  // of each pixel, by itself
  int maximum = 0;

  DropImageView view() const { return {zones, &patterns}; }
  RandomDrops(testing::Random& random, std::uint32_t columns, std::uint32_t rows, std::uint32_t max_base) {
    patterns.zone.emplace_back();
    for (std::uint8_t tile = 0; tile < 3; ++tile) {
      const unsigned rarity = 1 + random() % 20;
      for (std::uint32_t word = 0; word < kTileWords; ++word) {
        std::uint64_t bits = 0;
        for (unsigned bit = 0; bit < 64; ++bit) bits |= std::uint64_t{random() % rarity == 0} << bit;
        patterns.tile.push_back(bits);
      }
      patterns.zone.push_back({static_cast<std::uint8_t>(random() % (max_base + 1)), DropZone::Extra::kTile, tile});
      patterns.zone.push_back({static_cast<std::uint8_t>(random() % (max_base + 1))});
    }
    CorePattern& core = patterns.core;
    for (std::uint32_t* value : {&core.column_step, &core.row_step, &core.first, &core.threshold}) *value = random();
    if (random() % 3 == 0) core.threshold = 1u << 22;
    tabulate(core);
    patterns.zone.push_back({0, DropZone::Extra::kCore});
    zones.start(columns);
    const std::uint32_t longest = 1u << (random() % 9);
    const bool some_rows = random() % 2 != 0;
    for (std::uint32_t r = 0; r < rows; ++r) {
      for (std::uint32_t c = 0; c < columns && !(some_rows && r % 7 > 2);) {
        const std::uint32_t end = std::min(columns, c + 1 + static_cast<std::uint32_t>(random()) % longest);
        zones.append(c, end, static_cast<std::uint8_t>(random() % 9 % 8));
        c = end;
      }
      zones.end_row();
    }
    count(columns, rows);
  }

 private:
  void count(std::uint32_t columns, std::uint32_t rows) {
    drops.assign(rows, std::vector<int>(columns, 0));
    for (std::uint32_t r = 0; r < rows; ++r) {
      for (std::uint32_t i = zones.row_offset[r]; i < zones.row_offset[r + 1]; ++i) {
        const DropZone& zone = patterns.zone[zones.level[i]];
        for (std::uint32_t c = zones.change[2 * i]; c < zones.change[2 * i + 1]; ++c) {
          bool more = false;
          if (zone.extra == DropZone::Extra::kTile)
            more = (patterns.tile[zone.tile * kTileWords + 2 * (r % 128) + c % 128 / 64] >> (c % 64) & 1) != 0;
          const CorePattern& core = patterns.core;
          if (zone.extra == DropZone::Extra::kCore)
            more = c * core.column_step + r * core.row_step + core.first < core.threshold;
          maximum = std::max(maximum, drops[r][c] = zone.base + (more ? 1 : 0));
        }
      }
    }
  }
};

TEST(Compile, EveryDropOfADropImageIsFiredOnceRegardlessOfTheMounting) {
  for (std::uint32_t seed = 0; seed < 90; ++seed) {
    RandomMachine setup(5000 + seed);
    const HeadGrid grid = grid_of(setup.machine);
    const RandomDrops image(setup.random, grid.image.columns(), grid.image.rows(), seed % 4);
    SlowHead head(setup.machine, grid);
    CompileScratch scratch;
    std::uint64_t steps = 0;
    const auto count = compile(
        grid, image.view(), 5, scratch,
        [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
          head.sweep(sweep, vectors);
          // The first and the last step fire, and the listed ones are those that fire.
          std::vector<bool> fires(vectors.steps);
          for (std::size_t w = 0; w < vectors.bits.size(); ++w)
            fires[w / vectors.words] = fires[w / vectors.words] || vectors.bits[w] != 0;
          EXPECT_TRUE(fires.front() && fires.back());
          std::vector<bool> listed(vectors.steps);
          for (std::size_t k = 0; k + 1 < vectors.firing.size(); k += 2) {
            for (std::uint32_t s = vectors.firing[k]; s < vectors.firing[k + 1]; ++s) listed[s] = true;
            EXPECT_TRUE(k == 0 || vectors.firing[k] > vectors.firing[k - 1]);
          }
          EXPECT_EQ(fires, listed);
          steps += static_cast<std::uint64_t>(std::ranges::count(fires, true));
          return {};
        },
        seed);
    ASSERT_TRUE(count.ok());
    ASSERT_EQ(head.fired, image.drops) << "seed " << seed;
    EXPECT_EQ(head.outside, 0u);
    EXPECT_EQ(count->drops, head.drops);
    EXPECT_EQ(count->vectors, steps);
    EXPECT_EQ(count->moved + count->lost, 0u);
  }
}

TEST(Compile, WithBlockedNozzlesDropsDifferByExactlyWhatIsReported) {
  for (std::uint32_t seed = 0; seed < 90; ++seed) {
    RandomMachine setup(7000 + seed);
    auto& head_profile = setup.machine.head;
    if (head_profile.nozzles < 2) continue;
    for (unsigned i = 0; i < 1 + setup.random() % 6 && head_profile.blocked.size() + 1 < head_profile.nozzles; ++i) {
      head_profile.blocked.push_back(setup.random() % head_profile.nozzles);
    }
    const auto rule = static_cast<BlockedRule>(seed % 3);
    head_profile.blocked_rule = rule;
    const HeadGrid grid = grid_of(setup.machine);
    const RandomDrops image(setup.random, grid.image.columns(), grid.image.rows(), seed % 4);
    SlowHead head(setup.machine, grid);
    CompileScratch scratch;
    const auto count = compile(
        grid, image.view(), 5, scratch,
        [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
          head.sweep(sweep, vectors);
          return {};
        },
        seed);
    ASSERT_TRUE(count.ok());
    std::uint64_t missing = 0, added = 0;
    int highest = 0;
    for (std::size_t r = 0; r < image.drops.size(); ++r) {
      for (std::size_t c = 0; c < image.drops[r].size(); ++c) {
        const int wanted = image.drops[r][c], fired = head.fired[r][c];
        missing += static_cast<std::uint64_t>(std::max(0, wanted - fired));
        added += static_cast<std::uint64_t>(std::max(0, fired - wanted));
        highest = std::max(highest, fired);
      }
    }
    EXPECT_EQ(head.blocked_drops, 0u) << "seed " << seed;
    EXPECT_EQ(head.outside, 0u);
    EXPECT_LE(highest, image.maximum);
    EXPECT_EQ(added, count->moved) << "seed " << seed;
    EXPECT_EQ(missing, count->moved + count->lost) << "seed " << seed;
    if (rule == BlockedRule::kReport) {
      EXPECT_EQ(added, 0u);
    }
    if (rule == BlockedRule::kSecondPass) {
      EXPECT_EQ(missing, 0u) << "seed " << seed;
    }
  }
}

// Each plane of a drop image as an image of one drop gives the vectors of the sweeps of that drop.
TEST(Compile, SweepsOfADropAreThoseOfItsPlane) {
  for (std::uint32_t seed = 0; seed < 30; ++seed) {
    RandomMachine setup(9000 + seed);
    setup.machine.mounting.first_swath = FirstSwath::kBed;
    const HeadGrid grid = grid_of(setup.machine);
    const RandomDrops image(setup.random, grid.image.columns(), grid.image.rows(), 2);
    std::map<std::array<std::uint32_t, 3>, SweepVectors> of_drops, of_planes;
    std::uint32_t drop = 0;
    const auto keep = [&](auto& all) {
      return [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
        all[{drop + sweep.drop, sweep.swath, sweep.pass}] = vectors;
        return {};
      };
    };
    CompileScratch scratch;
    ASSERT_TRUE(compile(grid, image.view(), 4, scratch, keep(of_drops), seed).ok());
    for (; drop < 4; ++drop) {
      Image plane = image.drops;
      for (auto& row : plane) {
        for (int& pixel : row) pixel = pixel > static_cast<int>(drop) ? 1 : 0;
      }
      ASSERT_TRUE(compile(grid, runs_of(plane), scratch, keep(of_planes), seed).ok());
    }
    ASSERT_EQ(of_drops.size(), of_planes.size()) << seed;
    for (const auto& [key, vectors] : of_planes) {
      ASSERT_TRUE(of_drops.contains(key));
      const SweepVectors& same = of_drops[key];
      EXPECT_EQ(same.first_step, vectors.first_step);
      EXPECT_EQ(same.bits, vectors.bits) << seed;
      EXPECT_EQ(same.firing, vectors.firing);
    }
  }
}

TEST(HeadGrid, WhatCannotBePrintedIsOneLineThatNamesTheKey) {
  const auto refused = [](auto change, const std::string& what) {
    Machine machine = small_machine(128, 45, 100, 100);
    change(machine);
    const auto grid = make_head_grid(machine);
    ASSERT_FALSE(grid.ok()) << what;
    EXPECT_EQ(grid.error().fault, Fault::kUsage);
    EXPECT_NE(grid.error().message.find(what), std::string::npos) << grid.error().message;
    EXPECT_EQ(grid.error().message.find('\n'), std::string::npos);
  };
  refused([](Machine& m) { m.mounting.tilt_deg = 0; }, "mounting.tilt_deg: 0 degrees");
  refused([](Machine& m) { m.mounting.tilt_deg = 180; }, "mounting.tilt_deg: 180 degrees");
  refused([](Machine& m) { m.mounting.tilt_deg = 225; }, "half a turn or more");
  refused([](Machine& m) { m.head.pitch_um = 0; }, "head.pitch_um");
  refused([](Machine& m) { m.head.blocked.assign(129, 0); }, "head.blocked: 129 blocked nozzles of 128");
  refused([](Machine& m) { m.head.blocked = {128}; }, "there is no nozzle 128");
  refused([](Machine& m) { m.mounting.dpi = 100; }, "100 dpi across the scan cannot be reached");
  refused([](Machine& m) { m.motion.scan_speed_mm_s = 1000; }, "motion.scan_speed_mm_s");
  refused([](Machine& m) { m.mounting.overlap_lines = 65; }, "mounting.overlap_lines");
  refused([](Machine& m) { m.mounting.scan_from = Side::kFront; }, "mounting.scan_from");
  refused([](Machine& m) { m.head.row_offset_um = {0, 500}; }, "off its line");
}

}  // namespace
}  // namespace lamina::program
