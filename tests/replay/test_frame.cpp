// What stands about the layers of a program: as writers write it, it is taken; without one of its lines it is not.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>

#include "stages/replay/frame.h"
#include "tests/replay/tamper_bench.h"

namespace lamina {
namespace {

constexpr std::uint32_t kFramedLayers = 9;

struct Framed {
  pipeline::ResolvedMachine resolved;
  replay::VirtualMachine machine;
  std::string start, end;

  explicit Framed(const std::string& name, const std::function<void(Machine&)>& change)
      : resolved(printed_parts::shipped(name, change)),
        machine(*replay::VirtualMachine::build(resolved.machine, resolved.grid.image.columns(), resolved.grid.image.rows(),
                                               kFramedLayers)) {
    const auto writer = program::find_dialect(resolved.machine.dialect)->make_writer(resolved.machine, resolved.grid);
    program::ProgramBytes bytes;
    writer->start(kFramedLayers, bytes);
    start.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    bytes.clear();
    writer->end(bytes);
    end.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  std::string fault(const std::string& text) const {
    const Status status = replay::check_start(machine, text);
    return status.ok() ? std::string() : status.error().message;
  }
};

TEST(Frame, OfEachProfileIsTakenWithAndWithoutABase) {
  for (const auto& shipped : pipeline::shipped_machines()) {
    for (const std::uint32_t base : {0u, 3u}) {
      const Framed framed(std::string(shipped.name), [&](Machine& m) { m.powder.base_layers = base; });
      EXPECT_EQ(framed.fault(framed.start), "") << shipped.name;
      const Status end = replay::check_end(framed.machine, framed.end);
      EXPECT_TRUE(end.ok()) << shipped.name << (end.ok() ? "" : end.error().message);
    }
  }
}

// A line of the BrundleFab may be missing where each layer says it again, or where it is for a person's eyes.
TEST(Frame, LinesThatAreLeftOutAreReported) {
  for (const char* name : {"nuferbj", "hp45", "oasis", "reprap-inkjet", "brundlefab"}) {
    const Framed framed(name, [](Machine& m) { m.powder.base_layers = 3; });
    const bool bar = framed.resolved.machine.dialect == "brundlefab";
    std::size_t reported = 0;
    for (std::size_t at = 0; at < framed.start.size();) {
      const std::size_t end = framed.start.find('\n', at) + 1;
      const std::string line = framed.start.substr(at, end - at),
                        fault = framed.fault(framed.start.substr(0, at) + framed.start.substr(end));
      reported += !fault.empty();
      EXPECT_TRUE(!fault.empty() || bar || line[0] == ';') << name << ": " << line;
      at = end;
    }
    EXPECT_GE(reported, bar ? 4u : 3u) << name;
  }
}

TEST(Frame, HeadersSayTheHeadAndTheImage) {
  const Framed nuferbj("nuferbj", [](Machine&) {});
  for (const char* letter : {" L", " N", " W", " K", " Q"}) {
    std::string other = nuferbj.start;
    const std::size_t at = other.find(letter, other.find("M810")) + 2;
    other.insert(at, "1");
    EXPECT_NE(nuferbj.fault(other).find("M810 says"), std::string::npos) << letter << nuferbj.fault(other);
  }
  for (const char* name : {"xaar128-raw", "jet1000", "jet1000-grey"}) {
    const Framed framed(name, [](Machine&) {});
    for (std::size_t at = 0; at < framed.start.size(); at += 4) {
      std::string other = framed.start;
      other[at] = static_cast<char>(other[at] ^ 1);
      EXPECT_NE(framed.fault(other), "") << name << " byte " << at;
    }
    EXPECT_NE(framed.fault(framed.start + "1234"), "") << name;
    EXPECT_FALSE(replay::check_end(framed.machine, "").ok()) << name;
  }
}

TEST(Frame, UnitsPositionsAndZerosAreHeld) {
  const Framed hp45("hp45", [](Machine& m) { m.powder.base_layers = 3; });
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string text = hp45.start;
    EXPECT_NE(text.find(from), std::string::npos) << from;
    return hp45.fault(text.replace(text.find(from), from.size(), to));
  };
  EXPECT_NE(replaced("G21", "G20").find("G21 is missing"), std::string::npos);
  EXPECT_NE(replaced("G90", "G91").find("G90 is missing"), std::string::npos);
  EXPECT_NE(replaced("G92 Z-0.3000", "G92 Z-0.2000").find("-0.2 mm where -0.3 have to be"), std::string::npos);
  EXPECT_NE(replaced("G21", "M3 S1000").find("'M3' is no command of a program's begin"), std::string::npos);
  EXPECT_NE(replaced("G92 Z-0.3000", "G92 Z-0.3e0").find("'Z-0.3e0' is no word"), std::string::npos);
  EXPECT_FALSE(replay::check_end(hp45.machine, "BCL\nG1 X9 F9\n").ok());
}

}  // namespace
}  // namespace lamina
