// What a layer's program does with the powder, beside its drops: edited programs of the dialects that move axes by G-code.
#include <gtest/gtest.h>

#include "tests/program/machines.h"
#include "tests/replay/printed_parts.h"

namespace lamina {
namespace {

/// A shipped machine with a small bed, a filled layer and its program.
struct CycleBench {
  pipeline::ResolvedMachine resolved;
  Runs image;
  printed_parts::Program program;

  explicit CycleBench(const std::string& machine)
      : resolved(printed_parts::shipped(machine, [](Machine& m) {
          m.bed.size_mm = {12, 12};
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

// SerialGRBL.py, NewLayer: 0.25 mm below the top of a layer from 0.7 to 0.8 mm, and 0.25 mm beside 1.1 layers fed.
TEST(PowderCycle, WherePistonsStandWhilePowderIsSpreadIsHeld) {
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
