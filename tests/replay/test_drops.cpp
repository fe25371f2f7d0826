// Several drops a pixel: programs of all dialects give the image of each drop back.
#include <gtest/gtest.h>

#include "stages/data/levels.h"
#include "stages/replay/time/timer.h"
#include "tests/program/machines.h"
#include "tests/replay/printed_parts.h"

namespace lamina {
namespace {

/// A patch of random drops, 0 to 3 a pixel.
Levels random_drops(const PixelGrid& grid, std::uint32_t seed) {
  program::testing::Random random(seed);
  Levels levels;
  levels.start(grid.columns());
  const std::uint32_t rows = std::min(grid.rows(), 200u), columns = std::min(grid.columns(), 150u);
  for (std::uint32_t r = 0; r < grid.rows(); ++r) {
    for (std::uint32_t c = 20; r >= 10 && r < rows && c < columns;) {
      const std::uint32_t end = std::min(columns, c + 1 + random() % 9);
      levels.append(c, end, static_cast<std::uint8_t>(random() % 4));
      c = end;
    }
    levels.end_row();
  }
  return levels;
}

printed_parts::Program program_of_drops(const pipeline::ResolvedMachine& resolved, const Levels& levels, std::uint32_t drops,
                                        std::vector<std::uint32_t>& numbers) {
  const auto writer = program::find_dialect(resolved.machine.dialect)->make_writer(resolved.machine, resolved.grid);
  const LayerCycle cycle = printed_parts::cycle_of_layer();
  program::ProgramBytes bytes;
  writer->begin_layer(cycle, bytes);
  program::CompileScratch scratch;
  DropPatterns patterns;
  for (std::uint8_t n = 0; n < 10; ++n) patterns.zone.push_back({n});
  const DropImageView image{levels, &patterns};
  const auto count =
      program::compile(resolved.grid, image, drops, scratch, [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
        numbers.push_back(sweep.number);
        writer->sweep(sweep, vectors, bytes);
        return {};
      });
  EXPECT_TRUE(count.ok());
  writer->end_layer(cycle, bytes);
  return {std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()), *count};
}

class Drops : public testing::TestWithParam<const char*> {};

TEST_P(Drops, AreReplayedDropForDrop) {
  for (const BlockedRule rule : {BlockedRule::kReport, BlockedRule::kNeighbour, BlockedRule::kSecondPass}) {
    const auto resolved = printed_parts::shipped(GetParam(), [&](Machine& machine) {
      if (machine.head.blocked.empty()) machine.head.blocked = {4, 5, 9};
      machine.head.blocked_rule = rule;
    });
    const Levels levels = random_drops(resolved.grid.image, 7);
    std::array<Runs, 3> planes;
    for (std::uint8_t k = 0; k < 3; ++k) threshold_levels(levels, static_cast<std::uint8_t>(k + 1), planes[k]);
    const std::vector<RunsView> views(planes.begin(), planes.end());
    std::vector<std::uint32_t> numbers;
    const auto program = program_of_drops(resolved, levels, 3, numbers);
    std::ranges::sort(numbers);
    EXPECT_EQ(std::ranges::adjacent_find(numbers), numbers.end());
    EXPECT_EQ(program.count.drops + program.count.lost, sum_of_levels(levels));
    const auto machine =
        replay::VirtualMachine::build(resolved.machine, resolved.grid.image.columns(), resolved.grid.image.rows());
    ASSERT_TRUE(machine.ok());
    const auto replay = [&](std::span<const RunsView> wanted) {
      return machine->replay(program.text, printed_parts::kLayer, wanted, program.count.moved, program.count.lost);
    };
    const auto same = replay(views);
    ASSERT_TRUE(same.ok()) << same.error().message;
    EXPECT_EQ(same->drops, program.count.drops);
    const std::array<RunsView, 3> other{views[0], views[1], views[1]};
    EXPECT_FALSE(replay(other).ok());
    const auto fewer = replay(std::span(views).first(2));
    ASSERT_FALSE(fewer.ok());
    EXPECT_NE(fewer.error().message.find("more than 2 times"), std::string::npos) << fewer.error().message;
    EXPECT_FALSE(replay(std::span(views).first(1)).ok());
  }
}

/// A machine whose head fires `most` drops of a pixel, `allowed` of them at its speed.
pipeline::ResolvedMachine grey(const char* name, std::uint32_t maximum, std::uint32_t allowed) {
  return printed_parts::shipped(name, [&](Machine& machine) {
    machine.head.max_drops = maximum;
    const auto grid = program::make_head_grid(machine);
    machine.head.highest_frequency_hz = machine.motion.scan_speed_mm_s * 1e6 / grid->position_nm * (allowed + 0.5);
  });
}

class GreyDrops : public testing::TestWithParam<const char*> {};

TEST_P(GreyDrops, AreReplayedDropForDrop) {
  for (const auto& [maximum, allowed] : {std::pair{2u, 2u}, {3u, 3u}, {3u, 2u}, {7u, 7u}, {7u, 2u}, {15u, 15u}, {15u, 1u}}) {
    const auto resolved = grey(GetParam(), maximum, allowed);
    ASSERT_EQ(resolved.grid.sweep_drops, allowed);
    const Levels levels = random_drops(resolved.grid.image, maximum);
    std::array<Runs, 3> planes;
    for (std::uint8_t k = 0; k < 3; ++k) threshold_levels(levels, static_cast<std::uint8_t>(k + 1), planes[k]);
    const std::vector<RunsView> views(planes.begin(), planes.end());
    std::vector<std::uint32_t> numbers;
    const auto program = program_of_drops(resolved, levels, 3, numbers);
    EXPECT_EQ(program.count.drops, sum_of_levels(levels));
    const auto replay = [&](const Machine& of, std::span<const RunsView> wanted) {
      const auto machine = replay::VirtualMachine::build(of, resolved.grid.image.columns(), resolved.grid.image.rows());
      EXPECT_TRUE(machine.ok());
      return machine->replay(program.text, printed_parts::kLayer, wanted, 0, 0);
    };
    const auto same = replay(resolved.machine, views);
    ASSERT_TRUE(same.ok()) << maximum << " " << allowed << ": " << same.error().message;
    EXPECT_EQ(same->drops, program.count.drops);
    EXPECT_EQ(same->sweeps, numbers.size());
    EXPECT_EQ(same->max_per_position, std::min(3u, allowed));
    EXPECT_EQ(same->added, program.count.added);
    EXPECT_EQ(same->added > 0, allowed < std::min(3u, maximum));
    EXPECT_FALSE(replay(resolved.machine, std::array<RunsView, 3>{views[0], views[1], views[1]}).ok());
    EXPECT_FALSE(replay(resolved.machine, std::span(views).first(2)).ok());
    const std::uint32_t fired = std::min(3u, allowed);
    if (fired < 2) continue;
    // A head that fires fewer drops, or slower.
    Machine fewer = resolved.machine;
    fewer.head.max_drops = 2;
    if (maximum == 3 && fired == 3) {  // as many bits
      const auto reported = replay(fewer, views);
      ASSERT_FALSE(reported.ok());
      EXPECT_NE(reported.error().message.find("drops at one position, the head has at most"), std::string::npos);
    }
    Machine slower = resolved.machine;
    slower.head.highest_frequency_hz *= (fired - 0.5) / (allowed + 0.5);
    const auto reported = replay(slower, views);
    ASSERT_FALSE(reported.ok());
    EXPECT_NE(reported.error().message.find("times a second; they can"), std::string::npos) << reported.error().message;
  }
}

TEST_P(GreyDrops, OfBlockedNozzlesAreMovedAndMadeUp) {
  for (const BlockedRule rule : {BlockedRule::kReport, BlockedRule::kNeighbour, BlockedRule::kSecondPass}) {
    auto resolved = printed_parts::shipped(GetParam(), [&](Machine& machine) {
      machine.head.max_drops = 3;
      machine.head.highest_frequency_hz *= 2;
      machine.head.blocked = {4, 5, 9};
      machine.head.blocked_rule = rule;
    });
    ASSERT_GE(resolved.grid.sweep_drops, 2u);
    const Levels levels = random_drops(resolved.grid.image, 7);
    std::array<Runs, 3> planes;
    for (std::uint8_t k = 0; k < 3; ++k) threshold_levels(levels, static_cast<std::uint8_t>(k + 1), planes[k]);
    const std::vector<RunsView> views(planes.begin(), planes.end());
    std::vector<std::uint32_t> numbers;
    const auto program = program_of_drops(resolved, levels, 3, numbers);
    std::ranges::sort(numbers);
    EXPECT_EQ(std::ranges::adjacent_find(numbers), numbers.end());
    EXPECT_EQ(program.count.drops + program.count.lost, sum_of_levels(levels));
    const auto machine =
        replay::VirtualMachine::build(resolved.machine, resolved.grid.image.columns(), resolved.grid.image.rows());
    ASSERT_TRUE(machine.ok());
    const auto same = machine->replay(program.text, printed_parts::kLayer, views, program.count.moved, program.count.lost);
    ASSERT_TRUE(same.ok()) << same.error().message;
    EXPECT_EQ(same->drops, program.count.drops);
  }
}

INSTANTIATE_TEST_SUITE_P(TheirDialects, GreyDrops, testing::Values("xaar128-raw", "jet1000"));

/// A head of 4 nozzles square to its scan, 6 drops a pixel, on 8 x 4 pixels of 100 um.
pipeline::ResolvedMachine six_drops(const char* dialect) {
  Machine machine;
  machine.name = "six";
  machine.dialect = dialect;
  machine.head.nozzles = 4;
  machine.head.pitch_um = 100;
  machine.head.max_drops = 6;
  machine.motion.scan_speed_mm_s = 10;
  machine.bed.size_mm = {0.8, 0.4};
  auto resolved = pipeline::resolve_profile(machine);
  EXPECT_TRUE(resolved.ok());
  return *resolved;
}

/// Five drops of nozzle 0 and six of nozzle 2 at place 3.
std::string five_and_six(const pipeline::ResolvedMachine& resolved) {
  Levels levels;
  levels.start(8);
  levels.append(3, 4, 5);
  levels.end_row();
  levels.end_row();
  levels.append(3, 4, 6);
  levels.end_row();
  levels.end_row();
  std::array<Runs, 6> planes;
  for (std::uint8_t k = 0; k < 6; ++k) threshold_levels(levels, static_cast<std::uint8_t>(k + 1), planes[k]);
  const std::vector<RunsView> views(planes.begin(), planes.end());
  std::vector<std::uint32_t> numbers;
  return program_of_drops(resolved, levels, 6, numbers).text;
}

std::uint32_t word_at(const std::string& text, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t byte = 4; byte-- > 0;) value = value << 8 | static_cast<std::uint8_t>(text.at(at + byte));
  return value;
}

// As in the READMEs of the dialects: 5 = 101 and 6 = 110, the least significant bit first.
TEST(GreyPrograms, OfPlanesAreSpeltByHand) {
  const std::string text = five_and_six(six_drops("planes"));
  const std::size_t grey = 6 * 4;  // behind the layer's head
  const std::vector<std::uint32_t> head{0x4C06, 8 + 4, 0, 1, 0};
  for (std::size_t i = 0; i < head.size(); ++i) EXPECT_EQ(word_at(text, grey + 4 * i), head[i]) << i;
  const std::vector<std::uint32_t> rows{3, 1, 1, 4, 1u << 31, 1u << 29, (1u << 31) | (1u << 29), 0};
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(word_at(text, grey + 4 * (6 + i)), rows[i]) << i;
  EXPECT_EQ(word_at(text, grey + 4 * 14), 0x4C03u);
  program::ProgramBytes start;
  const auto resolved = six_drops("planes");
  program::find_dialect("planes")->make_writer(resolved.machine, resolved.grid)->start(9, start);
  const std::string begin(reinterpret_cast<const char*>(start.data()), start.size());
  EXPECT_EQ(begin.size(), 4u * 10);
  for (const auto& [word, value] : {std::pair{0u, 0x4C04u}, {1u, 8u}, {2u, 2u}, {3u, 9u}, {9u, 4u}})
    EXPECT_EQ(word_at(begin, 4 * word), value);
}

TEST(GreyPrograms, OfRawAreSpeltByHand) {
  const std::string text = five_and_six(six_drops("raw"));
  const std::size_t sweep = 4 + 5 * 4, segment = sweep + 4 + 3 * 4 + 8 + 4;
  ASSERT_EQ(text.substr(sweep, 4), "SWTH");
  EXPECT_EQ(word_at(text, segment), 3u);
  EXPECT_EQ(word_at(text, segment + 4), 1u);
  for (const auto& [bit, nozzles] : {std::pair{0, 1}, {1, 4}, {2, 5}, {3, 0}}) {
    const std::string vector = text.substr(segment + 8 + 16 * static_cast<std::size_t>(bit), 16);
    EXPECT_EQ(vector, std::string(15, '\0') + static_cast<char>(nozzles)) << bit;  // the highest byte first
  }
  EXPECT_EQ(text.substr(segment + 8 + 64, 4), "LEND");
}

// Three sweeps over the same steps in one direction; without two of them their ways there and back are saved.
TEST(AddedSweeps, TakeTheTimeOfTheirPaths) {
  for (const bool both : {false, true}) {
    const auto resolved = printed_parts::shipped("jet1000", [&](Machine& machine) { machine.motion.both_directions = both; });
    const auto& motion = resolved.machine.motion;
    const auto machine =
        replay::VirtualMachine::build(resolved.machine, resolved.grid.image.columns(), resolved.grid.image.rows());
    ASSERT_TRUE(machine.ok());
    const auto timed = [&](std::uint32_t sweeps) {
      replay::Timer timer(*machine);
      timer.begin(printed_parts::kLayer);
      for (std::uint32_t i = 0; i < sweeps; ++i) {
        const bool backward = both && i % 2 == 1;
        timer.sweep(10, backward, backward ? 1000 : 0, backward ? 0 : 1000, i > 0);
      }
      const auto count = timer.end();
      EXPECT_TRUE(count.ok());
      return std::pair(count->microseconds, timer.added_microseconds());
    };
    EXPECT_EQ(timed(1).second, 0);
    EXPECT_NEAR(static_cast<double>(timed(3).second), static_cast<double>(timed(3).first - timed(1).first), 1);
    // 1000 steps of 1 / 720 inch and two ramps, there at the speed of scans, and back at that of travels or of scans.
    const double way = 1000 * 25.4 / 720 + 2 * motion.ramp_mm;
    const double seconds = 2 * way * (1 / motion.scan_speed_mm_s + (both ? 0 : 1 / motion.travel_speed_mm_s));
    EXPECT_NEAR(static_cast<double>(timed(3).second) * 1e-6, seconds, 1e-5);
  }
}

// Two places of two sweeps each: without the second ones the head would run there over the first place and back over the other.
TEST(AddedSweeps, AreComparedWithSweepsThatRunBothDirections) {
  const auto resolved = printed_parts::shipped("jet1000", [](Machine& machine) { machine.motion.both_directions = true; });
  const auto machine =
      replay::VirtualMachine::build(resolved.machine, resolved.grid.image.columns(), resolved.grid.image.rows());
  ASSERT_TRUE(machine.ok());
  replay::Timer all(*machine), needed(*machine);
  all.begin(printed_parts::kLayer);
  needed.begin(printed_parts::kLayer);
  all.sweep(10, false, 0, 1000);
  all.sweep(10, true, 1000, 0, true);
  all.sweep(40, false, 0, 1000);
  all.sweep(40, true, 1000, 0, true);
  needed.sweep(10, false, 0, 1000);
  needed.sweep(40, true, 1000, 0);
  const auto with = all.end(), without = needed.end();
  ASSERT_TRUE(with.ok() && without.ok());
  EXPECT_EQ(all.added_microseconds(), with->microseconds - without->microseconds);
  EXPECT_GT(all.added_microseconds(), 0);
}

INSTANTIATE_TEST_SUITE_P(AllDialects, Drops,
                         testing::Values("nuferbj", "brundlefab", "hp45", "oasis", "reprap-inkjet", "xaar128-raw", "jet1000"));

}  // namespace
}  // namespace lamina
