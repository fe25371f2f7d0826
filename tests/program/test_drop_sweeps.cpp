// Several drops of a pixel in one sweep: how many a head's frequency allows, and what its nozzles fire then.
#include <gtest/gtest.h>

#include <numeric>

#include "pipeline/report/machine_text.h"
#include "stages/geometry/drop_rows.h"
#include "stages/program/compile.h"
#include "stages/program/dialect.h"
#include "tests/program/machines.h"

namespace lamina::program {
namespace {

/// A head square to a scan along x whose pixels are 100 um long: at 10 mm/s a nozzle passes 100 places a second.
Machine head_of(std::uint32_t max_drops, double highest_frequency_hz, std::uint32_t nozzles = 4) {
  Machine machine;
  machine.name = "test";
  machine.dialect = "planes";
  machine.head.nozzles = nozzles;
  machine.head.pitch_um = 100;
  machine.head.max_drops = max_drops;
  machine.head.highest_frequency_hz = highest_frequency_hz;
  machine.motion.scan_speed_mm_s = 10;
  machine.bed.size_mm = {0.8, 0.1 * nozzles};
  return machine;
}

HeadGrid grid_of_head(const Machine& machine) {
  auto grid = make_head_grid(machine);
  EXPECT_TRUE(grid.ok()) << (grid.ok() ? "" : grid.error().message);
  return *grid;
}

/// Rows of digits. maximum  of any pixel of the job
struct DigitDrops {
  Levels levels;
  DropPatterns patterns;  // zone n: n drops
  std::uint32_t maximum;
};
DigitDrops drops_of(const std::vector<std::string>& rows, std::uint32_t maximum) {
  DigitDrops drops{{}, {}, maximum};
  drops.levels.start(static_cast<std::uint32_t>(rows[0].size()));
  for (const std::string& row : rows) {
    for (std::uint32_t c = 0; c < row.size(); ++c) drops.levels.append(c, c + 1, static_cast<std::uint8_t>(row[c] - '0'));
    drops.levels.end_row();
  }
  for (std::uint8_t n = 0; n < 10; ++n) drops.patterns.zone.push_back({n});
  return drops;
}

struct FiredSweeps {
  std::vector<Sweep> sweeps;
  std::vector<std::vector<std::string>> drops;  // of each sweep, a row of digits a nozzle, by step from 0
  ProgramCount count;
};

FiredSweeps sweeps_fired_by(const HeadGrid& grid, const DigitDrops& drops) {
  FiredSweeps fired;
  CompileScratch scratch;
  const DropImageView image{drops.levels, &drops.patterns};
  const auto count =
      compile(grid, image, drops.maximum, scratch, [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
        fired.sweeps.push_back(sweep);
        std::vector<std::string> rows(grid.nozzles, std::string(grid.steps(), '0'));
        EXPECT_EQ(vectors.words, grid.words() * grid.drop_bits);
        for (std::uint32_t s = 0; s < vectors.steps; ++s) {
          for (std::uint32_t i = 0; i < grid.nozzles; ++i) {
            for (std::uint32_t bit = 0; bit < grid.drop_bits; ++bit) {
              const std::uint64_t word = vectors.bits[std::size_t{s} * vectors.words + bit * grid.words() + i / 64];
              rows[i][vectors.first_step + s] =
                  static_cast<char>(rows[i][vectors.first_step + s] + ((word >> i % 64 & 1) << bit));
            }
          }
        }
        fired.drops.push_back(std::move(rows));
        return {};
      });
  EXPECT_TRUE(count.ok());
  fired.count = *count;
  return fired;
}

// 100 places a second: of 350 Hz each gets 3 drops, of 299 Hz 2, of 700 Hz 7, and no more than the head has.
TEST(DropSweeps, FireWhatTheFrequencyAllows) {
  const auto drops = [](std::uint32_t maximum, double hertz) { return grid_of_head(head_of(maximum, hertz)).sweep_drops; };
  EXPECT_EQ(drops(7, 350), 3u);
  EXPECT_EQ(drops(7, 299), 2u);
  EXPECT_EQ(drops(7, 300), 3u);
  EXPECT_EQ(drops(7, 100), 1u);
  EXPECT_EQ(drops(7, 700), 7u);
  EXPECT_EQ(drops(7, 5000), 7u);
  EXPECT_EQ(drops(1, 5000), 1u);
  const auto too_fast = make_head_grid(head_of(7, 99));
  ASSERT_FALSE(too_fast.ok());
  EXPECT_NE(too_fast.error().message.find("scan at 9.9 mm/s or slower"), std::string::npos) << too_fast.error().message;
}

TEST(DropSweeps, TakeAsManyBitsAsTheHeadHasDrops) {
  for (const auto& [maximum, bits] : {std::pair{1u, 1u}, {2u, 2u}, {3u, 2u}, {4u, 4u}, {7u, 4u}, {15u, 4u}}) {
    EXPECT_EQ(grid_of_head(head_of(maximum, 100)).drop_bits, bits) << maximum;
  }
  for (const std::uint32_t maximum : {0u, 16u, 64u}) {
    const auto grid = make_head_grid(head_of(maximum, 1e5));
    ASSERT_FALSE(grid.ok());
    EXPECT_NE(grid.error().message.find("head.max_drops: give 1 to 15"), std::string::npos) << grid.error().message;
  }
  EXPECT_FALSE(make_head_grid(head_of(7, 1e5, 16'385)).ok());
  EXPECT_TRUE(make_head_grid(head_of(7, 1e5, 16'384)).ok());
}

TEST(DropSweeps, FireEachPixelsNumberOfDrops) {
  const std::vector<std::string> image{"01234567", "70000007", "00000000", "11111111"};
  const FiredSweeps fired = sweeps_fired_by(grid_of_head(head_of(7, 700)), drops_of(image, 7));
  ASSERT_EQ(fired.drops.size(), 1u);
  EXPECT_EQ(fired.drops[0], image);
  EXPECT_EQ(fired.count.drops, 28u + 14u + 8u);
  EXPECT_EQ(fired.count.sweeps, 1u);
  EXPECT_EQ(fired.count.added, 0u);
}

// Of a pattern some pixels get a drop more: bits of both numbers, of heads of any number of bits, within and beyond a sweep.
TEST(DropSweeps, FireTheDropsOfPatterns) {
  for (const auto& [maximum, allowed] : {std::pair{1u, 1u}, {2u, 2u}, {3u, 2u}, {7u, 3u}, {15u, 15u}}) {
    testing::Random random(maximum);
    Machine machine = head_of(maximum, 100.0 * allowed + 50, 70);
    machine.bed.size_mm[0] = 30;
    const HeadGrid grid = grid_of_head(machine);
    ASSERT_EQ(grid.sweep_drops, allowed);
    Levels zones;
    DropPatterns patterns;
    patterns.zone.emplace_back();
    for (std::uint8_t base = 0; base < 9; ++base) patterns.zone.push_back({base, DropZone::Extra::kTile, 0});
    for (std::uint32_t word = 0; word < kTileWords; ++word) patterns.tile.push_back(random() * std::uint64_t{0x100000001});
    zones.start(grid.image.columns());
    for (std::uint32_t r = 0; r < grid.image.rows(); ++r) {
      for (std::uint32_t c = 0; c < grid.image.columns();) {
        const std::uint32_t end = std::min(grid.image.columns(), c + 1 + random() % 90);
        zones.append(c, end, static_cast<std::uint8_t>(random() % 10));
        c = end;
      }
      zones.end_row();
    }
    std::vector<std::vector<int>> fired(grid.image.rows(), std::vector<int>(grid.image.columns(), 0));
    CompileScratch scratch;
    const auto count = compile(
        grid, DropImageView{zones, &patterns}, 9, scratch, [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
          std::uint32_t maximal = 0;
          for (std::uint32_t s = 0; s < vectors.steps; ++s) {
            for (std::uint32_t i = 0; i < grid.nozzles; ++i) {
              std::uint32_t drops = 0;
              for (std::uint32_t b = 0; b < grid.drop_bits; ++b) {
                const std::uint64_t word = vectors.bits[std::size_t{s} * vectors.words + b * grid.words() + i / 64];
                drops += static_cast<std::uint32_t>(word >> (i % 64) & 1) << b;
              }
              maximal = std::max(maximal, drops);
              if (drops > 0)
                fired[static_cast<std::size_t>(sweep.first_line + i)][vectors.first_step + s] += static_cast<int>(drops);
            }
          }
          EXPECT_EQ(sweep.drops, maximal);
          return {};
        });
    ASSERT_TRUE(count.ok());
    Levels wanted;
    levels_of(DropImageView{zones, &patterns}, wanted);
    EXPECT_EQ(count->drops, sum_of_levels(wanted));
    for (std::uint32_t r = 0; r < grid.image.rows(); ++r) {
      std::vector<int> row(grid.image.columns(), 0);
      for (std::uint32_t i = wanted.row_offset[r]; i < wanted.row_offset[r + 1]; ++i)
        std::fill(row.begin() + wanted.change[2 * i], row.begin() + wanted.change[2 * i + 1], wanted.level[i]);
      ASSERT_EQ(fired[r], row) << maximum << " " << r;
    }
  }
}

// Of 350 Hz 3 drops fit: 7 drops are 3 + 3 + 1. The head would have fired them in one sweep, so two are added.
TEST(DropSweeps, AreAddedWhereDropsComeTooFast) {
  const std::vector<std::string> image{"01234567", "00000000", "00000000", "00000002"};
  const FiredSweeps fired = sweeps_fired_by(grid_of_head(head_of(7, 350)), drops_of(image, 7));
  ASSERT_EQ(fired.drops.size(), 3u);
  EXPECT_EQ(fired.drops[0], (std::vector<std::string>{"01233333", "00000000", "00000000", "00000002"}));
  EXPECT_EQ(fired.drops[1], (std::vector<std::string>{"00001233", "00000000", "00000000", "00000000"}));
  EXPECT_EQ(fired.drops[2], (std::vector<std::string>{"00000001", "00000000", "00000000", "00000000"}));
  EXPECT_EQ(fired.count.drops, 28u + 2u);
  EXPECT_EQ(fired.count.added, 2u);
  for (std::uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(fired.sweeps[i].number, i);
    EXPECT_EQ(fired.sweeps[i].of, 3u);
    EXPECT_EQ(fired.sweeps[i].added, i > 0);
    EXPECT_EQ(fired.sweeps[i].drops, i < 2 ? 3u : 1u);
  }
}

// A pixel of d drops takes ceil(d / k) sweeps of k drops, and ceil(d / m) of a head that is fast enough.
TEST(DropSweeps, AddedOnesAreThoseBeyondTheHeadsOwn) {
  for (std::uint32_t maximum = 2; maximum <= 15; ++maximum) {
    for (std::uint32_t allowed = 1; allowed <= maximum; ++allowed) {
      const HeadGrid grid = grid_of_head(head_of(maximum, 100.0 * allowed));
      ASSERT_EQ(grid.sweep_drops, allowed);
      for (std::uint32_t drops = 1; drops <= 9; ++drops) {
        const std::string row = std::string("00") + static_cast<char>('0' + drops) + "00000";
        // Planes are those of the job, regardless of the layer.
        const FiredSweeps fired = sweeps_fired_by(grid, drops_of({row, "00000000", "00000000", "00000000"}, 12));
        const std::uint32_t sweeps = (drops + allowed - 1) / allowed, own = (drops + maximum - 1) / maximum;
        EXPECT_EQ(fired.sweeps.size(), sweeps);
        EXPECT_EQ(fired.count.added, sweeps - own) << maximum << " " << allowed << " " << drops;
        EXPECT_EQ(fired.count.drops, drops);
      }
    }
  }
}

TEST(DropSweeps, BothDirectionsToTheVectorsAgree) {
  for (const std::uint32_t ticks : {1u, 3u}) {
    Machine machine = head_of(7, 5000, 200);
    machine.head.row_offset_um = {0, 300};
    machine.motion.encoder_dpi = 254 * ticks;
    machine.motion.ticks_per_pixel = ticks;
    machine.motion.lag_unit = LagUnit::kTick;
    machine.bed.size_mm = {15, 20};
    const HeadGrid grid = grid_of_head(machine);
    testing::Random random(ticks);
    std::vector<std::vector<std::uint32_t>> changes(std::size_t{grid.nozzles} * grid.drop_bits);
    std::vector<ColumnChanges> lines;
    for (auto& line : changes) {
      for (std::uint32_t c = random() % 5; c < grid.positions && random() % 40 != 0; c += 1 + random() % 4) line.push_back(c);
      if (line.size() % 2 == 1) line.push_back(grid.positions);
      lines.emplace_back(line);
    }
    FireScratch scratch;
    SweepVectors by_changes, by_blocks;
    ASSERT_TRUE(fire(grid, lines, scratch, by_changes, FireWay::kChanges));
    ASSERT_TRUE(fire(grid, lines, scratch, by_blocks, FireWay::kBlocks));
    EXPECT_EQ(by_changes.first_step, by_blocks.first_step);
    EXPECT_EQ(by_changes.bits, by_blocks.bits);
    EXPECT_EQ(by_changes.firing, by_blocks.firing);
  }
}

TEST(DropSweeps, AreRefusedOfADialectOfOneDrop) {
  for (const program::Dialect& dialect : program::dialects()) {
    Machine machine = head_of(3, 5000);
    const HeadGrid grid = grid_of_head(machine);
    const Status status = program::check_dialect(dialect, machine, grid);
    const bool says = dialect.id == "planes" || dialect.id == "raw";
    EXPECT_EQ(status.ok(), says) << dialect.id;
    if (says) continue;
    EXPECT_NE(status.error().message.find("head.max_drops: 3"), std::string::npos) << status.error().message;
  }
}

TEST(DropSweeps, AreReported) {
  const Machine slow = head_of(7, 350), fast = head_of(7, 700);
  EXPECT_EQ(sweeps_text(fast, grid_of_head(fast), {12, 0, 0}), "2 over a position for up to 12 drops a pixel, up to 7 in each");
  EXPECT_EQ(
      sweeps_text(slow, grid_of_head(slow), {7, 20, 12.5}),
      "3 over a position for up to 7 drops a pixel: 350 Hz allow 3 of the head's 7 drops at 10 mm/s, all of them at 5.0 mm/s; "
      "that adds 20 sweeps, 12.5 s");
  EXPECT_NE(
      explain(slow, grid_of_head(slow), {}).find("3 of 7 of a pixel in one sweep at that speed, as 4 bits; all at 5.0 mm/s"),
      std::string::npos);
}

TEST(StreamedSweeps, HaveTheBytesOfWrittenOnes) {
  for (const std::uint32_t nozzles : {20u, 64u, 100u}) {
    const Machine machine = head_of(1, 100, nozzles);
    const HeadGrid grid = grid_of_head(machine);
    const auto writer = find_dialect(machine.dialect)->make_writer(machine, grid);
    SweepVectors vectors{7, 9000, grid.words(), {0, 5, 10, 8000, 8500, 9000}, {}};
    testing::Random random(nozzles);
    for (std::uint32_t i = 0; i < vectors.steps * vectors.words; ++i) vectors.bits.push_back(random());
    for (const bool backward : {false, true}) {
      const Sweep sweep{.number = 3, .of = 9, .backward = backward};
      ProgramBytes written{std::byte{1}}, streamed = written;
      std::size_t taken = 0;
      writer->sweep(sweep, vectors, written);
      const auto take = [&](std::span<const std::byte> bytes) -> Status {
        streamed.insert(streamed.end(), bytes.begin(), bytes.end());
        taken += bytes.size();
        return {};
      };
      ASSERT_TRUE(writer->stream_sweep(sweep, vectors, streamed, take));
      EXPECT_EQ(written, streamed) << nozzles << " nozzles" << (backward ? ", backward" : "");
      EXPECT_EQ(taken, nozzles == 20 ? 0 : 7990u * grid.words() * 8) << "only the long segment is passed on, if it has no gaps";
    }
  }
}

}  // namespace
}  // namespace lamina::program
