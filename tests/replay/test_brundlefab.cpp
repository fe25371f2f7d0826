// Programs for the BrundleFab, carried out by its firmware's rules: by lamina's decoder and by a port of its own.
#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "stages/replay/brundlefab/firmware.h"
#include "tests/program/machines.h"
#include "tests/replay/brundlefab_port.h"
#include "tests/replay/printed_parts.h"

namespace lamina {
namespace {

using printed_parts::Program;
using program::testing::Random;

constexpr double kDot = 25.4 / 96;
constexpr int kCoasts[] = {0, 9, 15};  // ticks that the motor may run on for when it is braked

/// What the port fires outside of the image. Every pixel has to be sprayed on at least six ticks of its dot, both ways.
struct BarFaults {
  std::size_t drops = 0, missing = 0, added = 0, travelling = 0;
  bool operator==(const BarFaults&) const = default;
};

BarFaults faults_of(const std::string& text, const pipeline::ResolvedMachine& resolved, const RunsView& image, int coast) {
  brundlefab_port::Printhead head(coast, 12345);
  brundlefab_port::Board(head).run(text);
  const auto& mount = resolved.machine.mounting;
  const std::int64_t columns = image.columns, rows = image.rows(), first = std::llround(mount.offset_mm[1] / kDot);
  std::vector<std::array<int, 2>> ticks(static_cast<std::size_t>(columns * rows));  // on the way there and back
  BarFaults found;
  for (const auto& spray : head.sprays_made) {
    found.travelling += spray.carriage_moves;
    const double left = (spray.carriage_mm + 195 - mount.offset_mm[0]) / kDot * mount.passes - 0.5;
    for (int nozzle = 0; nozzle < 12; ++nozzle) {
      if ((spray.pattern >> nozzle & 1) == 0) continue;
      const std::int64_t column = std::llround(left + nozzle * mount.passes), row = rows - 1 - (spray.dot - first);
      if (column < 0 || row < 0 || column >= columns || row >= rows) {
        ++found.added;
      } else {
        ++ticks[static_cast<std::size_t>(row * columns + column)][spray.forward ? 0 : 1];
      }
    }
  }
  for (std::int64_t i = 0; i < columns * rows; ++i) {
    const auto& both = ticks[static_cast<std::size_t>(i)];
    const bool set = printed_parts::is_set(image, i % columns, i / columns);
    found.drops += set && both[0] >= 6 && both[1] >= 6;
    found.added += !set && both[0] + both[1] > 0;
  }
  found.missing = set_pixels(image) - found.drops;
  return found;
}

void expect_printed(const pipeline::ResolvedMachine& resolved, const Runs& image, int coast, const std::string& what) {
  const Program program = printed_parts::program_of(resolved, image);
  const auto count = printed_parts::verified(resolved, image, program);
  ASSERT_TRUE(count.ok()) << what << ": " << count.error().message;
  EXPECT_EQ(count->drops, set_pixels(image) - program.count.lost) << what;
  const BarFaults found = faults_of(program.text, resolved, image, coast);
  EXPECT_EQ(found.added, program.count.moved) << what << ", the motor runs on for " << coast;
  EXPECT_EQ(found.missing, program.count.lost + program.count.moved) << what << ", the motor runs on for " << coast;
  EXPECT_EQ(found.travelling, 0u) << what;
}

TEST(Brundlefab, TwelveLayersOfFivePartsAreFiredAndNothingElse) {
  std::size_t drops = 0, number = 0;
  int layer = 0;
  for (const auto& part : printed_parts::kFiveParts) {
    const auto resolved = printed_parts::shipped("brundlefab", [&](Machine& machine) {
      if (++number % 2 == 0) machine.head.blocked = {0, 7};
      machine.head.blocked_rule = number == 4 ? BlockedRule::kSecondPass : BlockedRule::kReport;
      machine.mounting.passes = number == 3 ? 2 : 1;
      if (number == 3) machine.mounting.dpi = 192;
      machine.mounting.along_dpi = 96;
    });
    for (const Runs& image : printed_parts::twelve_layers(part.name, part.side_mm, part.at_mm, resolved.grid.image)) {
      expect_printed(resolved, image, kCoasts[layer++ % 3], part.name);
      drops += set_pixels(image);
    }
  }
  EXPECT_GT(drops, 300'000u);
}

/// The machine with a bed of so many dots.
pipeline::ResolvedMachine bar_machine(double columns, double rows) {
  return printed_parts::shipped("brundlefab", [&](Machine& machine) {
    machine.bed.size_mm = {columns * kDot - 1e-4, rows * kDot - 1e-4};
  });
}

TEST(Brundlefab, FirstAndLastDotsGapsAndPatternsAreFired) {
  Random random(4);
  for (const double rows : {1.0, 2.0, 37.0, 834.0}) {  // 834 and six to turn on are the whole bar
    const auto resolved = bar_machine(31, rows);
    const auto height = resolved.grid.image.rows();
    ASSERT_EQ(height, rows);
    for (int kind = 0; kind < 6; ++kind) {
      program::testing::Image image = random_image(random, resolved.grid.image.columns(), height);
      if (kind == 0) {
        for (auto& row : image) std::fill(row.begin(), row.end(), 1);
      }
      for (std::uint32_t r = 0; kind == 1 && r < height; ++r) {
        for (auto& pixel : image[r]) pixel = r == 0 || r + 1 == height;
      }
      for (std::uint32_t r = 0; kind == 2 && r < height; ++r) {  // blank stretches of 1, 2, 3, ... at odd and even dots
        for (auto& pixel : image[r]) pixel = r % 2 == 0 && (r * r / 7) % 5 < 2;
      }
      for (const int coast : kCoasts) {
        expect_printed(resolved, program::testing::runs_of(image), coast, fmt::format("{} rows, kind {}", rows, kind));
      }
    }
  }
}

/// Replaces the nth place of a text, from 0; an empty text if there is none.
std::string edited(std::string text, const std::string& from, const std::string& to, int nth = 0) {
  std::size_t at = text.find(from);
  for (; nth > 0 && at != std::string::npos; --nth) at = text.find(from, at + 1);
  if (at == std::string::npos) return {};
  return text.replace(at, from.size(), to);
}

TEST(Brundlefab, PlantedFaultsAreFound) {
  const auto resolved = bar_machine(40, 60);
  program::testing::Image image(60, std::vector<int>(40, 0));
  for (int r = 10; r < 50; ++r) {
    for (int c = 3; c < 33; ++c) image[std::size_t(r)][std::size_t(c)] = (r < 22 || r > 30) && c != 7;
  }
  const Runs runs = program::testing::runs_of(image);
  const Program good = printed_parts::program_of(resolved, runs);
  ASSERT_TRUE(printed_parts::verified(resolved, runs, good).ok());
  const std::string band = "T0\nT1 P0\nG0 Y0\n";
  const struct {
    const char* what;
    std::string from, to;
    int nth;
    bool other_drops;  // else a fault of powder or of what may happen where the bar turns
  } faults[] = {
      {"no wipe of what is in the buffer", "T21\nG1 Y222.38\nG0 Y0\n", "T21\n", 0, false},
      {"no pen offset", "G10 L1 P1 X195.0000\n", "", 0, true},
      {"another pen offset", "G10 L1 P1 X195.0000\n", "G10 L1 P1 X190.0000\n", 0, true},
      {"a pattern is not switched off before a gap", "T1 P0\nG1 Y10.72", "G1 Y10.72", 0, true},
      {"a pattern of other nozzles", "T1 P3960", "T1 P3952", 0, true},
      {"Q and R are not read", "T1 P3960", "T1 P0 Q3960", 0, true},
      {"P of 13 bits", "T1 P3960", "T1 P4096", 0, true},
      {"a run of equal dots at once", "G1 Y3.84\nG1 Y4.10\nG1 Y4.37\n", "G1 Y4.37\n", 0, true},
      {"two blank dots at once", "G1 Y3.31\n", "G1 Y2.51\nG1 Y3.04\nG1 Y3.31\n", 0, true},
      {"the pattern one dot too far", "G1 Y3.31\n", "G1 Y3.57\n", 0, true},
      {"Y at the edge of a dot", "G1 Y3.84\n", "G1 Y3.71\n", 0, false},
      {"the bar is not flushed before the carriage moves on", band, "", 0, true},
      {"the way back is left out", band, "T0\n", 0, true},
      {"the way back while the carriage moves", band, "T0\nT1 P0\nG0 Y0 X205\n", 0, true},
      {"the way back a dot aside", band, "T0\nG1 X200.6458\nT1 P0\nG0 Y0\n", 0, true},
      {"the next band's X before the way back", band, "T0\nG1 X204.0854\nT1 P0\nG0 Y0\n", 0, true},
      {"X of another band", "G1 X200.9104", "G1 X201.1750", 0, true},
      {"inches", "G21\n", "G20\n", 0, true},
      {"relative moves continue", "G1 E-2.0000 Z2.0000 F300\nG90\n", "G1 E-2.0000 Z2.0000 F300\n", 0, true},
      {"U is no axis", "G1 X400.0000", "G1 U400.0000", 0, false},
      {"no powder is fed", "G1 E0.1100 Z0.1000", "G1 Z0.1000", 0, false},
      {"the part bin does not go down", "G1 E0.1100 Z0.1000", "G1 E0.1100", 0, false},
      {"a fraction of a negative number", "G1 E2.0000 Z-2.0000", "G1 E2.0000 Z-1.9000", 0, false},
      {"powder is spread on bins that give way", "G1 X400.0000 F2000\nG91\nG1 E-2.0000 Z2.0000 F300\nG90\n",
       "G91\nG1 E-2.0000 Z2.0000 F300\nG90\nG1 X400.0000 F2000\n", 0, false},
      {"the bins do not give way", "G91\nG1 E-2.0000 Z2.0000 F300\nG90\n", "", 0, false},
      {"the recoater stays", "T21\nG0 X0.0000\n", "T21\n", 0, false},
      {"the pen spreads, not the recoater", "T21\nG1 Y222.38\nG0 Y0\nG91", "T21\nG1 Y222.38\nG0 Y0\nT1 P0\nG91", 0, false},
      {"a tool that is not there", "T21\nG0", "T2\nG0", 0, false},
      {"homing X in a layer", "G28 Y0", "G28 X0 Y0", 0, false},
      {"the last dots are not followed by blank ones", "T1 P0\nG1 Y14.16\nG1 Y14.42\nT0", "T0", 0, true},
      {"ten times the ink", "T1 P0 S6", "T1 P0 S60", 0, false},
      {"the blade is said to be where the pen is", "G10 L1 P21 X0.0000", "G10 L1 P21 X195.0000", 0, false},
      {"the last band's way back is left out", "T0\nT1 P0\nG0 Y0\nT21\nG0 X0", "T0\nT21\nG0 X0", 0, true},
      {"the last band stays on the bar", "G0 Y0\nT21\nG0 X0", "T21\nG0 X0", 0, true},
      {"the layer ends in relative moves", "G90\nM117 Done", "M117 Done", 0, false},
      {"the layer ends with the pen", "G90\nM117 Done", "G90\nT0\nM117 Done", 0, false},
      {"a bar faster than its sprays", "T1 P0 S6", "T1 P0 S2", 0, false},
  };
  std::size_t found = 0, by_port = 0;
  for (const auto& fault : faults) {
    Program bad = good;
    bad.text = edited(good.text, fault.from, fault.to, fault.nth);
    if (bad.text.empty()) {
      ADD_FAILURE() << fault.what << ": the program has no '" << fault.from << "'\n" << good.text.substr(0, 1500);
      continue;
    }
    const auto count = printed_parts::verified(resolved, runs, bad);
    EXPECT_FALSE(count.ok()) << fault.what;
    found += !count.ok();
    if (!fault.other_drops) continue;
    const bool other = faults_of(bad.text, resolved, runs, 9) != faults_of(good.text, resolved, runs, 9);
    EXPECT_TRUE(other) << fault.what << ": the port prints the same";
    by_port += other;
  }
  EXPECT_EQ(found, std::size(faults));
  EXPECT_GE(found, 30u);
  EXPECT_GE(by_port, 15u);
}

TEST(Brundlefab, BinsStayWithinTheirTravel) {
  const auto resolved = bar_machine(40, 60);
  const Runs runs = program::testing::runs_of(program::testing::Image(60, std::vector<int>(40, 0)));
  const Program program = printed_parts::program_of(resolved, runs);
  const auto machine = replay::VirtualMachine::build(resolved.machine, 40, 60);
  ASSERT_TRUE(machine.ok());
  const auto verified_above = [&](Nm bottom) {
    const Layer layer{7, bottom, 100'000, LayerReason::kUniform};
    return machine->replay(program.text, layer, runs, 0, 0).ok();
  };
  EXPECT_TRUE(verified_above(0));
  EXPECT_TRUE(verified_above(124'900'000));
  EXPECT_FALSE(verified_above(126'000'000));  // the feed bin would have to go to 140.7 mm
}

TEST(Brundlefab, NumbersAreReadAsTheFirmwareReadsThem) {
  using replay::brundle::Block;
  using replay::brundle::read_block;
  Block block;
  EXPECT_TRUE(read_block("G1 X12.25 Y-3 ; away", 1, block).ok());
  EXPECT_EQ(block.code, 'G');
  EXPECT_EQ(block.command, 1);
  EXPECT_EQ(block['X'], 12.25f);
  EXPECT_EQ(block['Y'], -3.0f);
  EXPECT_TRUE(read_block("G1 Z-1.5", 1, block).ok());
  EXPECT_EQ(block['Z'], -0.5f);  // neg * ipart + fpart / fbase
  EXPECT_TRUE(read_block("G1 X1", 25.4f, block).ok());
  EXPECT_FLOAT_EQ(block['X'], 25.4f);
  EXPECT_TRUE(read_block("M117 Slice 3 of 9", 1, block).ok());
  EXPECT_EQ(block.text, "Slice 3 of 9");
  EXPECT_FALSE(read_block("G1 X40000", 1, block).ok());
  EXPECT_FALSE(read_block("G1 X1.23456", 1, block).ok());
  EXPECT_FALSE(read_block("G1 X1*57", 1, block).ok());
}

/// What dotline.cpp itself leaves, compiled and run: an abc at dot 10 or 11, repeated.
TEST(Brundlefab, RepeatedDotsComeOutAsThePrintheadPacksThem) {
  const struct {
    int first, repeated;
    std::vector<int> dots;  // from the first on
    int ends;
  } cases[] = {
      {10, 1, {0xabc, 0xabc}, 12}, {10, 2, {0xabc, 0xabc, 0xabe}, 13}, {10, 3, {0xabc, 0xabc, 0xabe, 0xbc0}, 14},
      {11, 1, {0xabc}, 12},        {11, 2, {0xabc, 0xabe, 0xbc0}, 14}, {11, 4, {0xabc, 0xabe, 0xbc0, 0xabe, 0xbc0}, 16}};
  for (const auto& one : cases) {
    replay::brundle::InkBar bar;
    const auto to = [&](double dots) { return bar.move(static_cast<float>((dots + 0.5) * kDot)); };
    for (int dot = 1; dot <= one.first; ++dot) to(dot);
    bar.set_pattern(0xabc);
    to(one.first + 1 + one.repeated);
    bar.set_pattern(0x123);
    to(one.first + 2 + one.repeated);
    for (std::size_t i = 0; i < one.dots.size(); ++i) {
      EXPECT_EQ(bar.dot(one.first + static_cast<int>(i)), one.dots[i])
          << one.first << " repeated " << one.repeated << " dot " << i;
    }
    EXPECT_EQ(bar.dot(one.ends), 0x123) << one.first << " repeated " << one.repeated;
  }
}

TEST(Brundlefab, WhatTheMachineDoesNotHaveIsRefusedInALine) {
  const auto refused = [](auto&& change) {
    Machine machine = *pipeline::find_machine("brundlefab");
    change(machine);
    const auto resolved = pipeline::resolve_profile(machine);
    EXPECT_FALSE(resolved.ok());
    if (resolved.ok()) return std::string();
    EXPECT_EQ(resolved.error().fault, Fault::kUsage);
    EXPECT_EQ(resolved.error().message.find('\n'), std::string::npos);
    return resolved.error().message;
  };
  EXPECT_NE(refused([](Machine& m) { m.head.nozzles = 13; }).find("at most 12 nozzles"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.powder.roller_axis = "U"; }).find("has the axes X"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.powder.vats = 2; }).find("one feed bin"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.bed.build_height_mm = 140; }).find("143 of the part bin"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.powder.roller_mm[1] = 700; }).find("the recoater reaches"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.powder.dose = 1.2; }).find("152 of the feed bin"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.mounting.along_dpi = 192; }).find("96 dots an inch"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.mounting.offset_mm[1] = 0; }).find("can be inked"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.mounting.offset_mm[1] = 0.65; }).find("begin at its home"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.mounting.offset_mm[0] = 20; }).find("the pen reaches"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.bed.size_mm[1] = 230; }).find("can be inked"), std::string::npos);
  EXPECT_NE(refused([](Machine& m) {
              m.motion.scan_speed_mm_s = 400;
              m.head.highest_frequency_hz = 9000;
            }).find("sprays every"),
            std::string::npos);
  EXPECT_NE(refused([](Machine& m) { m.motion.travel_speed_mm_s = 600; }).find("16 bits"), std::string::npos);
}

double seconds_of(const auto& count) {
  if constexpr (requires { count.seconds(); }) {
    return count.seconds();
  } else {
    return count.seconds;
  }
}

TEST(Brundlefab, TheTimeIsThatOfTheBarAndTheCarriage) {
  // A band of 12 pixels a side at the front left: dots 2 to 13, so that 16 are gone over, both ways, 6 ms each: 0.192 s.
  // X goes from 0 to 400, back to the pen's 200.9104 - 195, and to 0 at 2000 mm/min: 24 s. Bins: 0.1487 mm and twice
  // 2.8284 mm at 5 mm/s: 1.1611 s.
  const auto resolved = bar_machine(40, 60);
  program::testing::Image image(60, std::vector<int>(40, 0));
  for (std::size_t r = 48; r < 60; ++r) {
    for (std::size_t c = 0; c < 12; ++c) image[r][c] = 1;
  }
  const Runs runs = program::testing::runs_of(image);
  const auto machine = replay::VirtualMachine::build(resolved.machine, 40, 60);
  ASSERT_TRUE(machine.ok());
  const auto count = machine->replay(printed_parts::program_of(resolved, runs).text, printed_parts::kLayer, runs, 0, 0);
  ASSERT_TRUE(count.ok()) << count.error().message;
  EXPECT_NEAR(seconds_of(*count), 0.192 + 24 + 1.1611, 0.001);
  EXPECT_EQ(count->sweeps, 1u);
  // The last of these dots is number 13, whose middle is 3.572 mm from home; the firmware's is 10 / 5250 further.
  EXPECT_NEAR(count->farthest_along_um, 6.80, 0.01);
}

}  // namespace
}  // namespace lamina
