// The order of head, roller, vats and lamp, what is loaded before a travel, and what programs count: each is reported by name.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "tests/replay/tamper_bench.h"

namespace lamina {
namespace {

using printed_parts::TamperBench;

/// The program with some of its lines in another place, or others among them.
class Reordered {
 public:
  explicit Reordered(const TamperBench& bench) : bench_(bench), lines_(bench.pieces) {}

  Reordered& move(const std::string& begin, const std::string& before, int n = 0) {
    const std::string line = lines_[position(begin, 0)];
    lines_.erase(at(position(begin, 0)));
    return insert(line, before, n);
  }
  Reordered& insert(const std::string& line, const std::string& before, int n = 0) {
    lines_.insert(at(position(before, n)), line);
    return *this;
  }
  Reordered& replace(const std::string& from, const std::string& to, int n = 0) {
    for (std::string& line : lines_) {
      const std::size_t found = line.find(from);
      if (found == std::string::npos || n-- > 0) continue;
      line.replace(found, from.size(), to);
      return *this;
    }
    ADD_FAILURE() << "no line has " << from;
    return *this;
  }
  std::string reported() const {
    std::string text;
    for (const std::string& line : lines_) text += line;
    return bench_.reported(text);
  }

 private:
  std::size_t position(const std::string& begin, int n) const {
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      if (lines_[i].starts_with(begin) && n-- == 0) return i;
    }
    ADD_FAILURE() << "no line begins with " << begin;
    return 0;
  }
  std::vector<std::string>::iterator at(std::size_t i) { return lines_.begin() + static_cast<std::ptrdiff_t>(i); }

  const TamperBench& bench_;
  std::vector<std::string> lines_;
};

void expect_in(const std::string& reported, const std::string& what) {
  EXPECT_NE(reported.find(what), std::string::npos) << "not '" << what << "' but: " << reported;
}

TEST(Order, OfRollerHeadAndVatsIsHeld) {
  for (const char* machine : {"nuferbj", "hp45", "reprap-inkjet"}) {
    SCOPED_TRACE(machine);
    const TamperBench bench(machine);
    const Machine& m = bench.resolved.machine;
    const bool host = m.dialect == "hp45";
    const std::string far = fmt::format("G1 U{:.4f}", m.powder.roller_mm[1]), travel = host ? "G1 X" : "G0 X";
    const std::string home = fmt::format("G1 U{:.4f}", m.powder.roller_mm[0]), back = bench.pieces[bench.find(home)];
    const std::string out = "the head moves while the roller is at";
    expect_in(Reordered(bench).move("G1 Z", home).reported(), "is spread with the build vat at");
    expect_in(Reordered(bench).move(home, "G91").reported(), out);  // it was at home, and stays out
    expect_in(Reordered(bench).move(home, travel, 1).reported(), out);
    expect_in(Reordered(bench).insert("G1 Z0.9 F300\nG1 Z0.8 F300\n", home).reported(), "a vat moves while the roller is at");
    expect_in(Reordered(bench).insert(fmt::format("{}9 Y9 F{:.0f}\n", travel, m.motion.travel_speed_mm_s * 60), far).reported(),
              "the roller moves while the head is at 9, 9 mm");
    expect_in(Reordered(bench).insert(back + bench.pieces[bench.find(far)], home).reported(),
              "powder cycle: the roller spreads ");
    // Down and up again between the sweeps: each layer would end well.
    const std::string sweep = host ? "BCL" : m.dialect == "nuferbj" ? "M812" : "G0 X", wait = host ? "G4 P0\n" : "";
    expect_in(Reordered(bench).insert("G1 Z1.8 F300\n" + wait, sweep, m.dialect == "nuferbj" ? 1 : 3).reported(),
              "the build vat at 1.8 mm");
    expect_in(Reordered(bench).insert("G1 X9 U9 F300\n", far).reported(), "moves two of head, roller and vats at a time");
  }
}

TEST(Order, OfTheLampAndTheCapIsHeld) {
  for (const char* machine : {"nuferbj", "oasis", "reprap-inkjet"}) {
    SCOPED_TRACE(machine);
    const TamperBench bench(machine);
    const bool host = bench.resolved.machine.dialect == "oasis";
    const std::string travel = host ? "G1 " : "G0 ";
    const std::string safe = fmt::format("{}X{:.4f}", travel, bench.resolved.machine.motion.safe_mm[0]);
    expect_in(Reordered(bench).move("M106", travel + "X-50.0000").reported(), "while the head is not at its cap");
    if (host) expect_in(bench.reported(bench.with(bench.find("M106") - 1, "")), "may still move");
    TamperBench open(machine, [](Machine& m) {
      printed_parts::all_maintenance_of(m);
      m.maintenance.cap_mm.reset();
    });
    expect_in(Reordered(open).move("M106", safe).reported(), "while the head is not at its safe position");
    expect_in(bench.reported(bench.with(bench.find("M106"), "")), "own lines come");
    // The lamp is on until its line comes.
    expect_in(bench.reported(bench.with(bench.find("M107"), bench.pieces[bench.find(safe, -1)] + "M107\n")),
              "the head moves before 'M107'");
  }
}

TEST(Order, VectorsAreLoadedWhereTheSweepBegins) {
  const TamperBench bench("nuferbj");
  expect_in(Reordered(bench).move("J", fmt::format("G0 X{}", "5")).reported(), "only the sweep may follow vectors");
  expect_in(Reordered(bench).replace(" D0", " D1").reported(), "have to go back");
  expect_in(Reordered(bench).replace(" D0", " D2").reported(), "D is 0, or 1");
  const std::string begin = bench.pieces[bench.find("M812") + 1];
  const double x = std::stod(begin.substr(4)), ramp = bench.resolved.machine.motion.ramp_mm;
  expect_in(Reordered(bench).replace(fmt::format("X{:.4f}", x), fmt::format("X{:.4f}", x + 1)).reported(),
            fmt::format("mm before the first drops and {:g} after", ramp));
}

TEST(Order, CountsAreThoseOfTheLayer) {
  const TamperBench bench("nuferbj");
  expect_in(Reordered(bench).replace("T9", "T8").reported(), "is of 8 layers, the job has 9");
  expect_in(Reordered(bench).replace("H0.1000", "H0.2000").reported(), "thickness is 0.2 mm where 0.1 have to be");
  expect_in(Reordered(bench).replace("M812 S0 T2", "M812 S0 T3").replace("M812 S1 T2", "M812 S1 T3").reported(),
            "states 3 swaths, and has 2");
  expect_in(Reordered(bench).replace("M812 S1 T2", "M812 S1 T3").reported(), "is one of 3 swaths, the preceding ones of 2");
  expect_in(Reordered(bench).replace("M812 S1", "M812 S2").reported(), "beyond the 2 that the layer has");
  expect_in(
      Reordered(bench).replace("M812 S1", "M812 S7").replace("M812 S0", "M812 S1").replace("M812 S7", "M812 S0").reported(),
      "and the swath of that number at line");
  TamperBench both = bench;
  both.resolved.machine.motion.both_directions = false;
  expect_in(both.reported(both.program.text), "fires only in forward sweeps");
}

TEST(Order, SpeedsAreThoseOfTheProfile) {
  for (const char* machine : {"nuferbj", "hp45", "reprap-inkjet"}) {
    SCOPED_TRACE(machine);
    const TamperBench bench(machine);
    const auto& motion = bench.resolved.machine.motion;
    const auto& powder = bench.resolved.machine.powder;
    const auto faster = [&](const std::string& begin, double mm_s) {
      const std::string line = bench.pieces[bench.find(begin)];
      return bench.reported(
          bench.with(bench.find(begin), line.substr(0, line.find(" F")) + fmt::format(" F{:.0f}\n", mm_s * 120)));
    };
    expect_in(faster("G1 Z", powder.vat_speed_mm_s), "a vat moves at");
    expect_in(faster("G1 U", powder.roller_speed_mm_s), "the roller moves at");
    const double fastest = std::max(motion.travel_speed_mm_s, motion.scan_speed_mm_s);
    expect_in(faster(bench.resolved.machine.dialect == "hp45" ? "G1 X" : "G0 X", fastest), "the head travels at");
  }
  const TamperBench bench("nuferbj");
  const double scan = bench.resolved.machine.motion.scan_speed_mm_s * 60;
  expect_in(Reordered(bench).replace(fmt::format(" F{:.0f}", scan), fmt::format(" F{:.0f}", scan / 2)).reported(), "scans at");
}

// State kept from another print must be set before the first line, and at its rest alone it forgets a sweep.
TEST(Order, OfLinesForTheHp45IsHeld) {
  const TamperBench bench("hp45", [](Machine& m) {
    printed_parts::all_maintenance_of(m);
    m.maintenance = {};
  });
  for (const char* setting : {"SPME", "SER", "SDP", "SDN", "SSID", "BMOD", "BCL"}) {
    expect_in(bench.reported(bench.with(bench.find(setting), "")), fmt::format("lines come before {}: ", setting));
  }
  expect_in(bench.reported(bench.with(bench.find("SEP"), "")), "before SEP sets the position of the head");
  const std::size_t sweep = bench.find("SBR", -1) + 1;
  ASSERT_TRUE(bench.pieces[sweep].starts_with("G1 "));
  ASSERT_EQ(bench.pieces[sweep + 1], "G4 P0\n");
  expect_in(bench.reported(bench.with(sweep + 1, "")), "moves on from a sweep without G4 P0");
  expect_in(bench.reported(bench.with(sweep, "G0" + bench.pieces[sweep].substr(2))), "G0 moves as fast as");
  std::string last = bench.pieces[sweep - 1];
  last[last.size() - 30] = 'B';
  expect_in(bench.reported(bench.with(sweep - 1, last)), "fires on the moves of the next layer");
  // Of the first line hangs what came before: it is read at once, or when the head is there.
  const std::size_t first = bench.find("SBR");
  std::string on = bench.pieces[first];
  on[on.size() - 30] = 'B';
  expect_in(bench.reported(bench.with(first, on)), "not all off");
  const std::string number = bench.pieces[first + 1].substr(4, bench.pieces[first + 1].find(' ', 4) - 4);
  std::string later = bench.pieces[first];
  later.replace(4, later.find(' ', 4) - 4, "H" + number.substr(1));
  expect_in(bench.reported(bench.with(first, later)), "the second one not ahead of it");
  // A run-out shorter than the ramp, in which the head brakes while it fires.
  const double to = std::stod(bench.pieces[sweep].substr(4)),
               from = std::stod(bench.pieces[bench.find("BCL", -1) - 2].substr(4));
  const double short_of = to > from ? to - 2 : to + 2;
  expect_in(bench.reported(bench.with(
                sweep, fmt::format("G1 X{:.4f}{}", short_of, bench.pieces[sweep].substr(bench.pieces[sweep].find(" F"))))),
            "where ramps of");
}

// SerialCommand::Update answers PRM before a drop is fired; the next answer comes behind the last one. 25000 are its most.
TEST(Order, NothingMovesWhileTheHp45MayPrime) {
  for (const char* machine : {"hp45", "oasis"}) {
    const TamperBench bench(machine);
    const std::size_t prime = bench.find("PRM");
    ASSERT_EQ(bench.pieces[prime + 1], "BCL\n");
    expect_in(bench.reported(bench.with(prime + 1, "")), "moves while PRM may still fire");
    const TamperBench long_shot(machine, [](Machine& m) {
      printed_parts::all_maintenance_of(m);
      m.maintenance.spit_drops = 60'000;
    });
    EXPECT_EQ(long_shot.reported(long_shot.program.text), "");
    EXPECT_EQ(std::ranges::count_if(long_shot.pieces, [](const auto& line) { return line.starts_with("PRM "); }), 3);
    expect_in(long_shot.reported(long_shot.with(long_shot.find("PRM"), "PRM OpI\n")), "up to 25000 bursts");  // 60,000
  }
}

TEST(Order, PistonsOfOasisComeFromBelow) {
  const TamperBench bench("oasis");
  const std::size_t spreads = bench.find("G1 Z0.5500"), prints = bench.find("G1 Z0.8000");
  expect_in(bench.reported(bench.with(spreads, bench.pieces[spreads] + "G1 Z0.5 F150\n" + bench.pieces[spreads])),
            "from above, and has play");
  expect_in(bench.reported(bench.with(prints - 1, "")), "from above, and has play");
  expect_in(bench.reported(bench.with(bench.find("G1 X475"), "G1 X475.0000 F3000\n")), "the spreader moves at 50 mm/s");
}

/// A record of raw: a tag, and how many numbers follow.
std::string record_of(const std::string& tag, const std::vector<std::int32_t>& numbers) {
  std::string bytes = tag;
  const auto put = [&](std::uint32_t number) {
    for (int i = 0; i < 4; ++i) bytes += static_cast<char>(number >> (8 * i) & 255);
  };
  put(static_cast<std::uint32_t>(numbers.size()));
  for (const std::int32_t number : numbers) put(static_cast<std::uint32_t>(number));
  return bytes;
}

// The host spreads a layer before the first record that is not of its powder, with the head at its safe place.
TEST(Order, OfRecordsIsHeld) {
  const TamperBench bench("xaar128-raw");
  const std::string roll = bench.pieces[bench.find("ROLL")], fill = record_of("FILL", {});
  const std::string cap = record_of("GOTO", {-50'000'000, -10'000'000}), safe = record_of("GOTO", {0, 0});
  EXPECT_EQ(bench.reported(bench.with(bench.find("ROLL"), safe + roll)), "");
  expect_in(Reordered(bench).insert(cap + fill + safe, "ROLL").reported(), "other numbers");  // it takes time
  expect_in(Reordered(bench).insert(fill, "ROLL").reported(), "the vats are filled while the head is not at its cap");
  expect_in(Reordered(bench).insert(cap, "ROLL").reported(), "ROLL comes while the head is not at its safe position");
  expect_in(Reordered(bench).insert(roll, "SWTH", 1).reported(), "ROLL comes after the layer's powder");
  expect_in(Reordered(bench).insert(fill, "SWTH", 1).reported(), "FILL comes after the layer's powder");
  const TamperBench still("xaar128-raw", [](Machine& m) {
    printed_parts::all_maintenance_of(m);
    m.powder.roller_rpm = 0;
  });
  expect_in(Reordered(still).insert(cap + fill, "GOTO").reported(), "after the pause to fill vats, not to its safe position");
}

}  // namespace
}  // namespace lamina
