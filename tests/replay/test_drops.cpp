// Several drops a pixel: programs of all dialects give the image of each drop back.
#include <gtest/gtest.h>

#include "stages/data/levels.h"
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

printed_parts::Program program_of_drops(const pipeline::ResolvedMachine& resolved, std::span<const RunsView> planes,
                                        std::vector<std::uint32_t>& numbers) {
  const auto writer = write::find_dialect(resolved.machine.dialect)->make_writer(resolved.machine, resolved.grid);
  LayerCycle cycle;
  cycle.layer = printed_parts::kLayer.index;
  cycle.layers = 9;
  cycle.bottom_nm = printed_parts::kLayer.bottom;
  cycle.thickness_nm = printed_parts::kLayer.thickness;
  write::ProgramBytes bytes;
  writer->begin_layer(cycle, bytes);
  program::CompileScratch scratch;
  const auto count =
      program::compile(resolved.grid, planes, scratch, [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
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
    for (std::uint8_t k = 0; k < 3; ++k) at_least(levels, static_cast<std::uint8_t>(k + 1), planes[k]);
    const std::vector<RunsView> views(planes.begin(), planes.end());
    std::vector<std::uint32_t> numbers;
    const auto program = program_of_drops(resolved, views, numbers);
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

INSTANTIATE_TEST_SUITE_P(AllDialects, Drops,
                         testing::Values("nuferbj", "brundlefab", "hp45", "oasis", "reprap-inkjet", "xaar128-raw", "jet1000"));

}  // namespace
}  // namespace lamina
