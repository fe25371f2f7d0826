// Layers replayed 64 pixels at a time: the verdict and the counts are those of drop by drop, of good programs and of bad ones.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <string>
#include <vector>

#include "stages/data/levels.h"
#include "stages/geometry/run_rows.h"
#include "stages/geometry/transpose.h"
#include "tests/program/machines.h"
#include "tests/replay/printed_parts.h"

namespace lamina {
namespace {

using program::testing::Random;

/// Changes a sweep before it is written; the first one that fires is number 0. returns  whether the sweep is written
using Plant = std::function<bool(std::size_t number, Sweep& sweep, SweepVectors& vectors)>;

/// A layer of several drops a pixel on a machine, and what its program prints of it.
struct WordBench {
  pipeline::ResolvedMachine resolved;
  Levels levels;  // drops of each pixel
  std::vector<Runs> planes;
  std::vector<RunRows> rows;
  std::vector<const BitRows*> expected;

  WordBench(const pipeline::ResolvedMachine& machine, std::uint32_t drops, std::uint32_t seed) : resolved(machine) {
    const PixelGrid& grid = resolved.grid.image;
    Random random(seed);
    const std::uint32_t part = 1 + random() % 3;
    levels.start(grid.columns());
    for (std::uint32_t r = 0; r < grid.rows(); ++r) {
      for (std::uint32_t c = 0; c < grid.columns();) {
        const std::uint32_t end = std::min(grid.columns(), c + 1 + random() % 5);
        if (random() % part == 0) levels.append(c, end, static_cast<std::uint8_t>(random() % (drops + 1)));
        c = end;
      }
      levels.end_row();
    }
    planes.resize(drops);
    for (std::uint32_t k = 0; k < drops; ++k) threshold_levels(levels, static_cast<std::uint8_t>(k + 1), planes[k]);
    for (const Runs& plane : planes) rows.emplace_back(plane);
    for (const RunRows& one : rows) expected.push_back(&one);
  }

  printed_parts::Program program(const Plant& plant = {}) const {
    const auto writer = program::find_dialect(resolved.machine.dialect)->make_writer(resolved.machine, resolved.grid);
    const LayerCycle cycle = printed_parts::cycle_of_layer();
    program::ProgramBytes bytes;
    writer->begin_layer(cycle, bytes);
    program::CompileScratch scratch;
    std::size_t number = 0;
    DropPatterns patterns;
    for (std::uint32_t n = 0; n <= planes.size(); ++n) patterns.zone.push_back({static_cast<std::uint8_t>(n)});
    const auto count = program::compile(
        resolved.grid, {levels, &patterns}, static_cast<std::uint32_t>(planes.size()), scratch,
        [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
          Sweep own = sweep;
          SweepVectors changed = vectors;
          if (!plant || plant(number, own, changed)) writer->sweep(own, changed, bytes);
          ++number;
          return {};
        },
        printed_parts::kLayer.index);
    EXPECT_TRUE(count.ok());
    writer->end_layer(cycle, bytes);
    return {std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()), *count};
  }

  replay::VirtualMachine machine() const {
    return *replay::VirtualMachine::build(resolved.machine, resolved.grid.image.columns(), resolved.grid.image.rows());
  }
};

void expect_same(const replay::Count& a, const replay::Count& b, const std::string& what) {
  EXPECT_EQ(a.drops, b.drops) << what;
  EXPECT_EQ(a.vectors, b.vectors) << what;
  EXPECT_EQ(a.sweeps, b.sweeps) << what;
  EXPECT_EQ(a.max_per_position, b.max_per_position) << what;
  EXPECT_EQ(a.added, b.added) << what;
  EXPECT_EQ(a.microseconds, b.microseconds) << what;
  EXPECT_EQ(a.added_microseconds, b.added_microseconds) << what;
  EXPECT_EQ(a.farthest_along_um, b.farthest_along_um) << what;
  EXPECT_EQ(a.farthest_across_um, b.farthest_across_um) << what;
}

/// Whether a program prints the image by words, which drop by drop it must do as well.
bool agrees(const WordBench& bench, const replay::VirtualMachine& machine, const std::string& text, std::uint64_t moved,
            std::uint64_t lost, const std::string& what) {
  const auto words = machine.replay_words(text, printed_parts::kLayer, bench.expected, moved, lost);
  const auto drops = machine.replay_drops(text, printed_parts::kLayer, bench.expected, moved, lost);
  EXPECT_EQ(words.ok(), drops.ok()) << what << ": " << (words.ok() ? drops.error().message : words.error().message);
  if (words.ok() && drops.ok()) expect_same(*words, *drops, what);
  const auto either = machine.replay(text, printed_parts::kLayer, bench.expected, moved, lost);
  EXPECT_EQ(either.ok(), drops.ok()) << what;
  if (!either.ok() && !drops.ok()) {
    EXPECT_EQ(either.error().message, drops.error().message) << what;
  }
  return words.ok();
}

/// A machine of any dialect, mounting and direction, with a blocked nozzle; heads of lamina's own dialects fire several drops.
Machine any_machine(Random& random, std::uint32_t seed) {
  const auto dialects = program::dialects();
  const program::Dialect& dialect = dialects[seed % dialects.size()];
  Machine machine = program::testing::random_machine(random, dialect.id, 12, dialect.max_nozzles);
  const bool own = machine.dialect == "planes" || machine.dialect == "raw";
  if (own && random() % 2 == 0) machine.head.max_drops = std::array{2u, 3u, 7u, 15u}[random() % 4];
  program::testing::fit_firmware(machine);
  return machine;
}

pipeline::ResolvedMachine of_pixels(Machine machine, double columns, double rows) {
  const auto whole = pipeline::resolve_profile(machine);
  EXPECT_TRUE(whole.ok()) << (whole.ok() ? "" : whole.error().message);
  const PixelGrid& grid = whole->grid.image;
  machine.bed.size_mm = {columns / grid.x.pixels_per_nm() / 1e6, rows / grid.y.pixels_per_nm() / 1e6};
  const auto small = pipeline::resolve_profile(machine);
  EXPECT_TRUE(small.ok()) << (small.ok() ? "" : small.error().message);
  return *small;
}

TEST(Words, AgreeWithDropsOnAnyMachineAndProgram) {
  std::size_t good = 0, bad = 0;
  for (std::uint32_t seed = 0; seed < 84; ++seed) {
    Random random(seed);
    const WordBench bench(of_pixels(any_machine(random, seed), 60 + random() % 300, 60 + random() % 300), 1 + seed / 7 % 3,
                          seed);
    const auto program = bench.program();
    const auto machine = bench.machine();
    const std::string name = fmt::format("{}, seed {}", bench.resolved.machine.dialect, seed);
    const std::uint64_t moved = program.count.moved, lost = program.count.lost;
    EXPECT_TRUE(agrees(bench, machine, program.text, moved, lost, name));
    EXPECT_FALSE(agrees(bench, machine, program.text, moved + 1, lost, name));
    EXPECT_FALSE(agrees(bench, machine, program.text, moved, lost + 1, name));
    for (int k = 0; k < 12; ++k) {
      std::string other = program.text;
      char& byte = other[random() % other.size()];
      byte = static_cast<char>(byte ^ 1 << random() % 7);
      (agrees(bench, machine, other, moved, lost, fmt::format("{}, change {}", name, k)) ? good : bad) += 1;
    }
  }
  EXPECT_GT(bad, 600u);  // the rest: of comments, and of speeds that no image shows
  EXPECT_LT(good, 400u);
}

void find_firing(SweepVectors& vectors) {
  vectors.firing.clear();
  for (std::uint32_t s = 0; s < vectors.steps; ++s) {
    const auto begin = vectors.bits.begin() + static_cast<std::ptrdiff_t>(std::size_t{s} * vectors.words);
    if (std::all_of(begin, begin + vectors.words, [](std::uint64_t word) { return word == 0; })) continue;
    if (vectors.firing.empty() || vectors.firing.back() != s) {
      vectors.firing.push_back(s);
      vectors.firing.push_back(s);
    }
    ++vectors.firing.back();
  }
}

/// 100 x 100 pixels below a head of 16 nozzles: 32 lines of 2 words are open at most, each with 9 words around it.
TEST(Words, MemoryIsThatOfTheLinesOfTwoSwaths) {
  Machine machine = program::testing::small_machine(16, 90, 100, 100);
  const auto bytes = [&](std::uint32_t planes) {
    const auto built = replay::VirtualMachine::build(machine, 100, 100);
    EXPECT_TRUE(built.ok());
    return std::array{std::uint64_t{built->max_open_lines()}, built->bytes_of_replay(planes), built->bytes_of_drops(planes)};
  };
  constexpr std::uint64_t kWindow = 8 * 256 * 2, kLines = 16 * 100;
  EXPECT_EQ(bytes(1), (std::array<std::uint64_t, 3>{32, 8 * 32 * 11 + kWindow + kLines, 8 * 2 * 100}));
  EXPECT_EQ(bytes(3), (std::array<std::uint64_t, 3>{32, 2 * 8 * 32 * 11 + kWindow + kLines, 2 * 8 * 2 * 100}));
  machine.head.blocked = {3};  // of each of 100 / 16 swaths and two at the edges: its line and two next to it
  EXPECT_EQ(bytes(1)[0], 32 + 3 * 8);
  machine.head.blocked.clear();
  machine.mounting = {.tilt_deg = 0, .scan_axis = ScanAxis::kY, .scan_from = Side::kFront, .nozzle_0 = Side::kLeft};
  EXPECT_EQ(bytes(1)[1], 8 * 32 * 11 + kWindow + kLines + 8 * (100 * 2 + 100 + 64)) << "the image is turned over";
}

// More lines than two swaths have lack a drop: words give up, and the place of the first is found all the same.
TEST(Words, AFaultOnEveryLineIsOneOfItsFirst) {
  const WordBench bench(of_pixels(program::testing::small_machine(16, 90, 100, 100), 100, 100), 1, 7);
  const auto bad = bench.program([&](std::size_t, Sweep&, SweepVectors& vectors) {
    for (std::uint32_t step = 40; step < 60; ++step) {
      const auto begin = vectors.bits.begin() + static_cast<std::ptrdiff_t>(std::size_t{step} * vectors.words);
      std::fill(begin, begin + vectors.words, 0);
    }
    find_firing(vectors);
    return true;
  });
  EXPECT_FALSE(agrees(bench, bench.machine(), bad.text, 0, 0, "a band of steps is left out"));
}

// --- planted faults

bool fires_at(const HeadGrid& grid, const SweepVectors& vectors, std::uint32_t step, std::uint32_t nozzle,
              std::uint32_t bit = 0) {
  const std::uint32_t at = nozzle ^ grid.bit_order;
  return (vectors.bits[std::size_t{step} * vectors.words + bit * grid.words() + at / 64] >> (at % 64) & 1) != 0;
}

void set_nozzle(const HeadGrid& grid, SweepVectors& vectors, std::uint32_t step, std::uint32_t nozzle, bool on,
                std::uint32_t bit = 0) {
  const std::uint32_t at = nozzle ^ grid.bit_order;
  std::uint64_t& word = vectors.bits[std::size_t{step} * vectors.words + bit * grid.words() + at / 64];
  const std::uint64_t one = std::uint64_t{1} << (at % 64);
  word = on ? word | one : word & ~one;
}

/// A step and a nozzle that fires there while the one after it does not, near the middle of a sweep.
struct Spot {
  std::uint32_t step = 0, nozzle = 0;
};
Spot spot_of(const HeadGrid& grid, const SweepVectors& vectors) {
  for (std::uint32_t step = vectors.steps / 2; step + 2 * grid.steps_per_pixel < vectors.steps; ++step) {
    for (std::uint32_t nozzle = 6; nozzle + 1 < grid.nozzles; ++nozzle) {
      if (fires_at(grid, vectors, step, nozzle) && !fires_at(grid, vectors, step, nozzle + 1) &&
          !fires_at(grid, vectors, step + grid.steps_per_pixel, nozzle)) {
        return {step, nozzle};
      }
    }
  }
  ADD_FAILURE() << "no such drop";
  return {};
}

void copy_step(SweepVectors& vectors, std::uint32_t from, std::uint32_t to) {
  for (std::uint32_t w = 0; w < vectors.words; ++w)
    vectors.bits[std::size_t{to} * vectors.words + w] = vectors.bits[std::size_t{from} * vectors.words + w];
}

using VectorChange = void (*)(const HeadGrid& grid, Spot spot, Sweep& sweep, SweepVectors& vectors);
const std::pair<const char*, VectorChange> kChanges[] = {
    {"a drop left out",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) { set_nozzle(grid, v, at.step, at.nozzle, false); }},
    {"a drop too many",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) { set_nozzle(grid, v, at.step, at.nozzle + 1, true); }},
    {"a drop of the next nozzle",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) {
       set_nozzle(grid, v, at.step, at.nozzle, false);
       set_nozzle(grid, v, at.step, at.nozzle + 1, true);
     }},
    {"a drop a pixel late",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) {
       set_nozzle(grid, v, at.step, at.nozzle, false);
       set_nozzle(grid, v, at.step + grid.steps_per_pixel, at.nozzle, true);
     }},
    {"a drop a step late",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) {
       set_nozzle(grid, v, at.step, at.nozzle, false);
       set_nozzle(grid, v, at.step + 1, at.nozzle, true);
     }},
    {"a step left out",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) {
       for (std::uint32_t nozzle = 0; nozzle < grid.nozzles; ++nozzle) set_nozzle(grid, v, at.step, nozzle, false);
     }},
    {"a step again",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) { copy_step(v, at.step, at.step + grid.steps_per_pixel); }},
    {"a nozzle that fires nothing",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) {
       for (std::uint32_t step = 1; step + 1 < v.steps; ++step) set_nozzle(grid, v, step, at.nozzle, false);
     }},
    {"a nozzle that fires always",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) {
       for (std::uint32_t step = 0; step < v.steps; ++step) set_nozzle(grid, v, step, at.nozzle, true);
     }},
    {"a blocked nozzle that fires",
     [](const HeadGrid& grid, Spot at, Sweep&, SweepVectors& v) { set_nozzle(grid, v, at.step, grid.blocked.front(), true); }},
    {"a sweep one line off", [](const HeadGrid&, Spot, Sweep& sweep, SweepVectors&) { ++sweep.first_line; }},
};

TEST(Words, PlantedFaultsAreFoundAndDescribed) {
  std::size_t planted = 0;
  for (const char* name : {"jet1000", "xaar128-raw", "nuferbj-360dpi"}) {
    const auto resolved = printed_parts::shipped(name, [](Machine& machine) { machine.head.blocked = {5}; });
    const WordBench bench(of_pixels(resolved.machine, 400, 400), 1, 8);
    const HeadGrid& grid = bench.resolved.grid;
    const auto machine = bench.machine();
    const auto good = bench.program();
    ASSERT_TRUE(agrees(bench, machine, good.text, good.count.moved, good.count.lost, name));
    for (const auto& [what, change] : kChanges) {
      const VectorChange change_it = change;
      const auto program = bench.program([&](std::size_t number, Sweep& sweep, SweepVectors& vectors) {
        if (number != 0) return true;
        change_it(grid, spot_of(grid, vectors), sweep, vectors);
        find_firing(vectors);
        return true;
      });
      ASSERT_NE(program.text, good.text) << name << ": " << what;
      ASSERT_FALSE(agrees(bench, machine, program.text, good.count.moved, good.count.lost, what)) << name << ": " << what;
      const auto fault = machine.replay(program.text, printed_parts::kLayer, bench.expected, good.count.moved, good.count.lost);
      EXPECT_NE(fault.error().message.find("layer 7, swath "), std::string::npos)
          << name << ", " << what << ": " << fault.error().message;
      EXPECT_NE(fault.error().message.find(", step "), std::string::npos)
          << name << ", " << what << ": " << fault.error().message;
      ++planted;
    }
    // A sweep that is missing.
    const auto fewer = bench.program([](std::size_t number, Sweep&, SweepVectors&) { return number != 0; });
    EXPECT_FALSE(agrees(bench, machine, fewer.text, good.count.moved, good.count.lost, name));
    ++planted;
  }
  EXPECT_GE(planted, 31u);
}

// A drop less, a drop more, more than the head has, each of one pixel.
TEST(Words, FaultsOfSeveralDropsAreFound) {
  for (const char* name : {"jet1000", "xaar128-raw"}) {
    const auto resolved = printed_parts::shipped(name, [](Machine& machine) {
      machine.head.max_drops = 5;
      machine.head.highest_frequency_hz *= 5;
    });
    const WordBench bench(of_pixels(resolved.machine, 200, 200), 3, 5);
    const HeadGrid& grid = bench.resolved.grid;
    ASSERT_EQ(grid.drop_bits, 4u);
    const auto machine = bench.machine();
    const auto good = bench.program();
    ASSERT_TRUE(agrees(bench, machine, good.text, 0, 0, name));
    for (const std::uint32_t by : {1u, 2u, 4u, 7u, 8u}) {
      const auto program = bench.program([&](std::size_t number, Sweep&, SweepVectors& vectors) {
        if (number != 0) return true;
        const Spot at = spot_of(grid, vectors);
        for (std::uint32_t bit = 0; bit < 4; ++bit) {
          if ((by >> bit & 1) != 0)
            set_nozzle(grid, vectors, at.step, at.nozzle, !fires_at(grid, vectors, at.step, at.nozzle, bit), bit);
        }
        find_firing(vectors);
        return true;
      });
      EXPECT_FALSE(agrees(bench, machine, program.text, 0, 0, fmt::format("{} by {}", name, by)));
    }
  }
}

TEST(Words, SquaresAreTurnedOver) {
  Random random(3);
  std::uint64_t square[64], turned[64];
  for (std::uint64_t& word : square) word = std::uint64_t{random()} << 32 | random();
  std::copy_n(square, 64, turned);
  transpose_square(turned);
  for (unsigned i = 0; i < 64; ++i) {
    for (unsigned j = 0; j < 64; ++j) ASSERT_EQ(square[i] >> j & 1, turned[j] >> i & 1);
  }
}

}  // namespace
}  // namespace lamina
