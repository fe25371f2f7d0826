// Faults of a program of hp45 or of its machine are found and reported.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "tests/replay/hp45_bench.h"

namespace lamina::hp45_bench {
namespace {

TEST(Hp45, PlantedFaultsAreFound) {
  const SlottedDisc disc({20, 20});
  const Lines& sound = disc.lines;
  ASSERT_TRUE(disc.verdict_of(sound).ok());
  const std::size_t first = index_of_line(sound, "SBR"), second_sweep = index_of_line(sound, "BCL", 1);
  const std::size_t sweep_1 =
      first + static_cast<std::size_t>(std::find_if(sound.begin() + static_cast<std::ptrdiff_t>(first), sound.end(),
                                                    [](const auto& l) { return l[0] == 'G'; }) -
                                       (sound.begin() + static_cast<std::ptrdiff_t>(first)));
  const std::size_t gap =
      first + 1 +
      static_cast<std::size_t>(std::find_if(sound.begin() + static_cast<std::ptrdiff_t>(first) + 1, sound.end(), all_off) -
                               (sound.begin() + static_cast<std::ptrdiff_t>(first) + 1));
  ASSERT_LT(gap, sweep_1 - 1) << "no gap";
  const auto erase = [](Lines& lines, std::size_t at) { lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(at)); };
  // The position's last digit but one, up or down by one: 64 um.
  const auto shift = [](std::string& line, int by) {
    line[line.find(' ', 4) - 2] = static_cast<char>(line[line.find(' ', 4) - 2] + by);
  };
  const std::vector<std::pair<const char*, std::function<void(Lines&)>>> faults = {
      {"no all-off before the first line", [&](Lines& l) { erase(l, first); }},
      {"no all-off before a gap", [&](Lines& l) { erase(l, gap); }},
      {"no all-off at the end", [&](Lines& l) { erase(l, sweep_1 - 1); }},
      {"a change is missing", [&](Lines& l) { erase(l, first + 5); }},
      {"the first column is missing", [&](Lines& l) { erase(l, first + 1); }},
      {"the last column is missing", [&](Lines& l) { erase(l, sweep_1 - 2); }},
      {"a line is a pixel late",
       [&](Lines& l) { shift(l[first + 5], l[first + 5][l[first + 5].find(' ', 4) - 2] == 'z' ? -1 : 1); }},
      {"the whole sweep is shifted",
       [&](Lines& l) {
         for (std::size_t i = first; i < sweep_1; ++i) l[i][l[i].find(' ', 4) - 1] = 'A';
       }},
      {"the buffer is rewound", [&](Lines& l) { l[second_sweep] = "BRES"; }},
      {"the buffer is cleared before the sweep",
       [&](Lines& l) { l.insert(l.begin() + static_cast<std::ptrdiff_t>(sweep_1), "BCL"); }},
      {"a nozzle more", [&](Lines& l) { l[first + 1].back() = l[first + 1].back() == 'B' ? 'C' : 'B'; }},
      // Which verify would not miss: its drops fall on the line of another one.
      {"nozzle 0, which is blocked", [&](Lines& l) { l[first + 1][l[first + 1].size() - 50] = 'g'; }},
      {"nozzles the other way round",
       [&](Lines& l) {
         for (auto& line : l)
           if (line.starts_with("SBR")) std::reverse(line.end() - 50, line.end());
       }},
      {"a character is missing", [&](Lines& l) { l[first + 9].pop_back(); }},
      {"a character that is no digit", [&](Lines& l) { l[first + 9].back() = '='; }},
      {"a swath is missing",
       [&](Lines& l) {
         l.erase(l.begin() + static_cast<std::ptrdiff_t>(second_sweep),
                 l.begin() + static_cast<std::ptrdiff_t>(index_of_line(l, "SBR", -1)) + 3);
       }},
      {"a sweep's movement is missing", [&](Lines& l) { erase(l, sweep_1); }},
      {"300 dpi", [&](Lines& l) { l[index_of_line(l, "SDP")] = "SDP Es"; }},
      {"half the density", [&](Lines& l) { l[index_of_line(l, "SDN")] = "SDN y"; }},
      {"another encoder", [&](Lines& l) { l[index_of_line(l, "SER")] = "SER Es"; }},
      {"one row of nozzles", [&](Lines& l) { l[index_of_line(l, "SSID")] = "SSID B"; }},
      {"a buffer that is kept", [&](Lines& l) { l[index_of_line(l, "BMOD")] = "BMOD B"; }},
      {"no wait before the lines", [&](Lines& l) { erase(l, index_of_line(l, "G4", 0)); }},
      {"no wait behind the sweep",
       [&](Lines& l) {
         erase(l, index_of_line(l, "G4", 2));
         erase(l, index_of_line(l, "G4", 1));
       }},
      {"the encoder is not zeroed", [&](Lines& l) { erase(l, index_of_line(l, "SEP")); }},
      {"the encoder is zeroed elsewhere", [&](Lines& l) { l[index_of_line(l, "SEP")] = "SEP A"; }},
      {"lines before the head is at its start",
       [&](Lines& l) {
         std::rotate(l.begin() + static_cast<std::ptrdiff_t>(first) - 4, l.begin() + static_cast<std::ptrdiff_t>(first),
                     l.begin() + static_cast<std::ptrdiff_t>(sweep_1));
       }},
      {"a sweep in parts of mm/s", [&](Lines& l) { l[sweep_1].replace(l[sweep_1].find(" F"), 7, " F14990"); }},
      // 20 mm/s are 472 counts a second.
      {"a sweep that the controller takes for rest", [&](Lines& l) { l[sweep_1].replace(l[sweep_1].find(" F"), 7, " F1200"); }},
      // 25,400 counts an inch and moves of metres would keep verify busy.
      {"another encoder behind the sweeps", [&](Lines& l) { l.insert(l.end() - 1, "SER GM4"); }},
      {"the head leaves the machine",
       [&](Lines& l) {
         l.insert(l.end() - 3, {"G1 X5000 F15000", "G1 X-5000 F15000"});
       }},
      {"the head goes to and fro over lines that are not done",
       [&](Lines& l) {
         l.insert(l.end() - 3, {"SBR ///// " + std::string(50, 'A'), "G1 X60 F15000"});
         for (int i = 0; i < 9; ++i) l.insert(l.end() - 3, i % 2 == 0 ? "G1 X10" : "G1 X60");
       }},
      {"the sweep ends early", [&](Lines& l) { l[sweep_1] = "G1 X40.0000 F15000"; }},
      {"the head goes over the lines backwards",
       [&](Lines& l) {
         std::reverse(l.begin() + static_cast<std::ptrdiff_t>(first), l.begin() + static_cast<std::ptrdiff_t>(sweep_1));
       }},
      {"a swath is one line off its position",
       [&](Lines& l) {
         auto& g = l[first - 4];
         g.replace(g.find('Y'), g.find(" F") - g.find('Y'), "Y40.0365");
       }},
      {"the program ends early", [&](Lines& l) { l.pop_back(); }}};
  EXPECT_GE(faults.size(), 30u);
  for (const auto& [name, plant] : faults) {
    Lines lines = sound;
    plant(lines);
    ASSERT_NE(lines, sound) << name;
    const auto printed = disc.verdict_of(lines);
    EXPECT_FALSE(printed.ok()) << name << " is not found";
    if (!printed.ok() && std::getenv("LAMINA_SHOW") != nullptr) std::printf("%s: %s\n", name, printed.error().message.c_str());
  }
}

TEST(Hp45, EncoderFarFinerThanPixelsIsFoundWhereTheProfileNamesNone) {
  const SlottedDisc disc({20, 10}, [](Machine& machine) { machine.motion.encoder_dpi = 0; });
  Lines lines = disc.lines;
  const auto sound = disc.verdict_of(lines);
  ASSERT_TRUE(sound.ok()) << sound.error().message;
  lines[index_of_line(lines, "SER")] = "SER GM4";  // 25,400
  const auto printed = disc.verdict_of(lines);
  ASSERT_FALSE(printed.ok());
  EXPECT_NE(printed.error().message.find("far more than pixels of 42.3 um need"), std::string::npos) << printed.error().message;
}

TEST(Hp45, RewindsThatWouldKeepVerifyBusyAreFound) {
  const SlottedDisc disc({20, 10});
  Lines lines = disc.lines;
  for (int i = 0; i < 9; ++i) lines.insert(lines.end() - 1, "BRES");
  const auto printed = disc.verdict_of(lines);
  ASSERT_FALSE(printed.ok());
  EXPECT_NE(printed.error().message.find("again and again"), std::string::npos) << printed.error().message;
}

TEST(Hp45, DropsThatFallWhileTheHeadTravelsAreCounted) {
  const SlottedDisc disc({20, 10},
                         [](Machine& machine) { machine.head.blocked_rule = BlockedRule::kReport; });  // a single sweep
  Lines lines = disc.lines;
  // The lines again behind the sweep: the head passes them on its way to where it waits, from X 50 to 0.
  lines.insert(lines.end() - 3, {"BRES", "G1 X10.0000 F15000", "G4 P0", "G1 X60.0000 F15000", "G4 P0"});
  const auto printed = disc.verdict_of(lines);
  ASSERT_FALSE(printed.ok());
  EXPECT_NE(printed.error().message.find(std::to_string(disc.program.count.drops) + " drops fall while the head travels"),
            std::string::npos)
      << printed.error().message;
}

TEST(Hp45, WhatTheControllerCannotDoIsRefusedWithTheKey) {
  const auto refused = [](const std::function<void(Machine&)>& change, std::string_view key) {
    Machine machine = shipped_by_name("hp45");
    change(machine);
    const auto resolved = resolve_profile(machine);
    ASSERT_FALSE(resolved.ok()) << key;
    EXPECT_EQ(resolved.error().fault, Fault::kUsage);
    EXPECT_NE(resolved.error().message.find(key), std::string::npos) << resolved.error().message;
  };
  refused([](Machine& m) { m.head.row_offset_um = {0, 4050}; }, "head.row_offset_um");
  refused([](Machine& m) { m.head.blocked = {6, 56, 115, 127, 167, 256}; }, "head.blocked");
  for (const std::uint32_t nozzle : {0u, 6u, 56u, 115u, 127u, 129u, 167u, 256u, 263u, 291u}) {
    refused([&](Machine& m) { std::erase(m.head.blocked, nozzle); }, fmt::format("cannot fire nozzle {},", nozzle));
  }
  // 150 nozzles of 300 npi are pairs.
  refused(
      [](Machine& m) {
        m.head.nozzles = 150, m.head.pitch_um = 25'400.0 / 300, m.mounting.dpi = 300, m.head.blocked = {0, 64};
      },
      "cannot fire nozzle 131, its tables give it another one's channel; name 0, 64 and 131");
  refused([](Machine& m) { m.motion.scan_speed_mm_s = 25; }, "forgets those below 26");
  // 600 counts a second of a strip of 600 an inch are 25.4 mm/s.
  for (const double speed : {1.0, 25.0, 50.5, 249.99}) {
    refused([&](Machine& m) { m.motion.scan_speed_mm_s = speed; }, "motion.scan_speed_mm_s");
  }
  refused([](Machine& m) { m.motion.encoder_dpi = 1200, m.motion.scan_speed_mm_s = 12; }, "give 13 or a higher whole number");
  refused([](Machine& m) { m.bed.size_mm = {170, 100}; }, "bed.size_mm");
  refused([](Machine& m) { m.motion.encoder_dpi = 300; }, "motion.encoder_dpi");
  refused([](Machine& m) { m.motion.encoder_dpi = 650; }, "motion.encoder_dpi");
  refused([](Machine& m) { m.motion.encoder_dpi = 1200, m.motion.ticks_per_pixel = 2, m.motion.lag_unit = LagUnit::kTick; },
          "motion.lag_unit");
}

}  // namespace
}  // namespace lamina::hp45_bench
