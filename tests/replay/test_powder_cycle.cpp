// Powder handling of a layer's program, in addition to drops: edited programs of the dialects that move axes by G-code.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>

#include "stages/program/program_text.h"
#include "tests/program/machines.h"
#include "tests/replay/printed_parts.h"

namespace lamina {
namespace {

/// A shipped machine with a small bed, a filled layer and its program.
struct CycleBench {
  pipeline::ResolvedMachine resolved;
  Runs image;
  printed_parts::Program program;

  explicit CycleBench(const std::string& machine, const std::function<void(Machine&)>& change = nullptr)
      : resolved(printed_parts::shipped(machine, [&](Machine& m) {
          m.bed.size_mm = {12, 12};
          if (change) change(m);
        })) {
    const PixelGrid& grid = resolved.grid.image;
    image = program::testing::runs_of(program::testing::Image(grid.rows(), std::vector<int>(grid.columns(), 1)));
    program = printed_parts::program_of(resolved, image);
  }

  /// Empty if the text is found to be sound.
  std::string fault(const std::string& text) const {
    const auto count = printed_parts::verified(resolved, image, {text, program.count});
    return count.ok() ? std::string() : count.error().message;
  }
  /// The program with other lines, without those that become empty.
  std::string edited(auto&& change) const {
    std::string text;
    for (std::size_t at = 0; at < program.text.size();) {
      const std::size_t end = program.text.find('\n', at);
      const std::string line = change(program.text.substr(at, end - at));
      if (!line.empty()) text += line + "\n";
      at = end + 1;
    }
    return text;
  }
};

const char* const kCycleMachines[] = {"nuferbj", "hp45", "oasis", "reprap-inkjet"};

TEST(PowderCycle, LayerThatGetsNoPowderIsFound) {
  for (const char* name : kCycleMachines) {
    const CycleBench bench(name);
    ASSERT_EQ(bench.fault(bench.program.text), "") << name;
    const auto& powder = bench.resolved.machine.powder;
    const auto without = [&](const std::string& axes) {
      return bench.fault(bench.edited([&](const std::string& line) {
        const bool moves = line.starts_with("G1 ") && axes.find(line[3]) != std::string::npos;
        return moves ? std::string() : line;
      }));
    };
    const std::string vats = powder.build_axis + powder.feed_axes[0] + powder.feed_axes[1];
    EXPECT_NE(without(vats).find("powder cycle: the build vat does not move"), std::string::npos) << name << without(vats);
    EXPECT_NE(without(powder.feed_axes[0] + powder.feed_axes[1]).find("powder cycle: "), std::string::npos) << name;
  }
}

TEST(PowderCycle, PowderThatIsSpreadOverTheDropsIsFound) {
  for (const char* name : {"nuferbj", "hp45", "reprap-inkjet"}) {
    const CycleBench bench(name);
    LayerCycle cycle;
    cycle.bottom_nm = printed_parts::kLayer.bottom;
    cycle.thickness_nm = printed_parts::kLayer.thickness;
    program::ProgramBytes bytes;
    program::put_powder_cycle(bench.resolved.machine, cycle, bytes);
    const std::string moves(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    std::string text = bench.program.text;
    const std::size_t at = text.find(moves);
    ASSERT_NE(at, std::string::npos) << name << "\n" << moves << text.substr(0, 300);
    text.erase(at, moves.size());
    // Before the head goes back to where it waits: behind the last sweep.
    text.insert(text.rfind(bench.resolved.machine.motion.x_axis + "0.0000 "), moves);
    const std::size_t inserted = text.find(moves), line = text.rfind('\n', inserted) + 1;
    text.erase(inserted, moves.size()).insert(line, moves);
    EXPECT_NE(bench.fault(text).find("the first sweep begins before powder is spread"), std::string::npos)
        << name << bench.fault(text);
  }
}

TEST(PowderCycle, AHeadThatWaitsNextToItsPositionIsFound) {
  for (const char* name : kCycleMachines) {
    const CycleBench bench(name);
    const double waits = bench.resolved.machine.motion.safe_mm[0];
    const std::string there = fmt::format("X{:.4f} ", waits), neighbour = fmt::format("X{:.4f} ", waits + 1);
    std::string text = bench.program.text;
    const std::size_t last = text.rfind(there);
    ASSERT_NE(last, std::string::npos) << name;
    text.replace(last, there.size(), neighbour);
    EXPECT_NE(bench.fault(text).find("and the next layer finds it at"), std::string::npos) << name << bench.fault(text);
  }
}

TEST(PowderCycle, AVatThatTheMachineDoesNotHaveIsFound) {
  const CycleBench bench("hp45");
  const std::string other =
      bench.edited([](const std::string& line) { return line.starts_with("G1 A") ? "G1 B" + line.substr(4) : line; });
  ASSERT_NE(other, bench.program.text);
  EXPECT_NE(bench.fault(other).find("the machine has no axis B"), std::string::npos) << bench.fault(other);
}

// A roller on the gantry moves as the head's axis does.
TEST(PowderCycle, RollersOnTheGantryAreDetected) {
  for (const char* name : {"nuferbj", "hp45", "reprap-inkjet"}) {
    const CycleBench bench(name, [](Machine& m) { m.powder.roller_axis = m.motion.x_axis; });
    EXPECT_EQ(bench.fault(bench.program.text), "") << name;
    const std::string far = "G1 X" + fmt::format("{:.4f}", bench.resolved.machine.powder.roller_mm[1]);
    const std::string stays =
        bench.edited([&](const std::string& line) { return line.starts_with(far) ? std::string() : line; });
    ASSERT_NE(stays, bench.program.text) << name;
    EXPECT_NE(bench.fault(stays).find("the roller does not reach its far end"), std::string::npos) << name;
  }
}

// 100 times a second are 9.694 mm/s, which F582 says: 9.7.
TEST(PowderCycle, ScansAtTheNozzlesFastestAreNoFaultWhereTheirSpeedIsRounded) {
  const CycleBench bench("nuferbj", [](Machine& m) {
    m.head.highest_frequency_hz = 100;
    m.motion.scan_speed_mm_s = 100 * 0.0969443;
  });
  EXPECT_EQ(bench.fault(bench.program.text), "");
  const std::string faster = bench.edited([](const std::string& line) {
    const std::size_t speed = line.find("F582");
    return speed == std::string::npos ? line : line.substr(0, speed) + "F584";
  });
  EXPECT_NE(bench.fault(faster).find("they can 100"), std::string::npos) << bench.fault(faster);
}

// 0.48 mm a minute.
TEST(PowderCycle, VerySlowVatsMove) {
  const CycleBench bench("nuferbj", [](Machine& m) { m.powder.vat_speed_mm_s = 0.008; });
  EXPECT_NE(bench.program.text.find(" F0.48\n"), std::string::npos);
  EXPECT_EQ(bench.fault(bench.program.text), "");
}

TEST(PowderCycle, BlanksAreInNoProgram) {
  for (const char* name : kCycleMachines) {
    const CycleBench bench(name);
    const std::string before =
        bench.edited([](const std::string& line) { return line.starts_with("G1 ") ? " " + line : line; });
    EXPECT_NE(bench.fault(before).find("begins with a blank"), std::string::npos) << name << bench.fault(before);
    const std::string twice =
        bench.edited([](const std::string& line) { return line.starts_with("G1 ") ? "G1 " + line.substr(2) : line; });
    EXPECT_NE(bench.fault(twice).find("'' is no word"), std::string::npos) << name << bench.fault(twice);
  }
}

// Forty vectors of no nozzle, a hundred million times each, under a head that goes round the world.
TEST(PowderCycle, RepeatsOfNothingTakeNoTime) {
  const CycleBench bench("nuferbj");
  std::string loads;
  for (std::int64_t i = 1; i < 41; ++i) {
    loads += fmt::format("\nJ{} 00000000 00000000 00000000 00000000\nR99999998", i * 100'000'000);
  }
  bool sweeping = false;
  const std::string text = bench.edited([&](const std::string& line) {
    const bool loaded = line.starts_with("M812"), scans = sweeping && line.starts_with("G1 X");
    sweeping = loaded || (sweeping && !scans);
    return loaded ? line : scans ? loads.substr(1) + "\nG1 X9000000000 F18000" : line;
  });
  ASSERT_NE(text, bench.program.text);
  EXPECT_EQ(bench.fault(text), "");
}

TEST(PowderCycle, FeedingToAHeightAndALayerThatEndsRelativeAreFound) {
  for (const char* name : kCycleMachines) {
    const CycleBench bench(name);
    const std::string absolute = bench.fault(bench.edited([](const std::string& line) { return line == "G91" ? "" : line; }));
    EXPECT_NE(absolute.find("feeds to a height"), std::string::npos) << name << absolute;
    const std::string& text = bench.program.text;
    const std::string last = name == std::string("nuferbj") ? "M813" : name == std::string("reprap-inkjet") ? "M400" : "BRL";
    std::string relative = text;
    relative.insert(relative.rfind(last), "G91\n");
    EXPECT_NE(bench.fault(relative).find("ends in G91"), std::string::npos) << name << bench.fault(relative);
  }
}

// SerialGRBL.py, NewLayer: 0.25 mm below the top of a layer from 0.7 to 0.8 mm, and 0.25 mm in addition to 1.1 layers fed.
TEST(PowderCycle, WherePistonsAreWhilePowderIsSpreadIsHeld) {
  const CycleBench bench("oasis");
  ASSERT_EQ(bench.fault(bench.program.text), "");
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string text = bench.program.text;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? std::string() : bench.fault(text.replace(at, from.size(), to));
  };
  EXPECT_NE(replaced("G1 Z0.5500", "G1 Z0.8000").find("spread with the build vat at 0.8 mm where 0.55 have to be"),
            std::string::npos);
  // The dose of the whole layer is right, but 0.1 mm of it come behind the spreader.
  const std::string late = bench.edited([](const std::string& line) {
    if (line.starts_with("G1 A-1.3600")) return std::string("G1 A-1.2600 F150");
    return line.starts_with("G1 A-0.7500") ? std::string("G1 A-0.8500 F150") : line;
  });
  ASSERT_NE(late, bench.program.text);
  EXPECT_NE(bench.fault(late).find("spread with 0.26 mm fed where 0.36 have to be"), std::string::npos) << bench.fault(late);
  EXPECT_NE(replaced("M4\n", "M4\nG1 Z3 F150\nG1 Z0.55 F150\n").find("a piston moves while powder is spread"),
            std::string::npos);
  EXPECT_NE(replaced("M4\n", "").find("M5 stops"), std::string::npos);
  EXPECT_NE(replaced("M5\n", "").find("a piston moves while powder is spread"), std::string::npos);
}

TEST(PowderCycle, NumbersThatAreNoneAreFound) {
  for (const char* name : kCycleMachines) {
    const CycleBench bench(name);
    const std::string build = "G1 " + bench.resolved.machine.powder.build_axis;
    for (const char* number : {"nan", "inf", "-inf"}) {
      const std::string text =
          bench.edited([&](const std::string& line) { return line.starts_with(build) ? build + number + " F300" : line; });
      ASSERT_NE(text, bench.program.text);
      EXPECT_NE(bench.fault(text).find("is no word"), std::string::npos) << name << " " << number << bench.fault(text);
    }
  }
}

}  // namespace
}  // namespace lamina
