// What verify tells of programs in which something is missing or says another number: all, but for what the machine takes
// without harm, which is named with the reason.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/replay/tamper_bench.h"

namespace lamina {
namespace {

using printed_parts::TamperBench;

const struct {
  const char* machine;
  std::vector<std::string> harmless;  // begins of lines that may be missing, once others of their kind are there
} kTampered[] = {
    {"nuferbj", {}},
    // The buffer is empty behind each sweep, and the encoder counts on.
    {"hp45", {"BCL", "SEP "}},
    // GRBL keeps the order of its lines: a wait before a travel is for the host.
    {"oasis", {"BCL", "SEP ", "G4 P0"}},
    {"reprap-inkjet", {}},
    {"xaar128-raw", {}},
    {"jet1000", {}},
    {"jet1000-grey", {}},
    // Dots of one pattern may be loaded by one line where the printhead packs them rightly; a change of tools that runs
    // nothing; a place that is that of the line before, relative or not.
    {"brundlefab", {"G1 Y", "G10 L1 P0 ", "G28 Y0", "G90", "T0", "T1 P", "G1 X400"}},
};

TEST(Tampering, WhatIsLeftOutIsReported) {
  for (const auto& [machine, harmless] : kTampered) {
    const TamperBench bench(machine);
    ASSERT_EQ(bench.reported(bench.program.text), "") << machine;
    std::size_t tried = 0, taken = 0;
    for (std::size_t i = 0; i < bench.pieces.size(); ++i) {
      const std::string& piece = bench.pieces[i];
      if (piece[0] == ';') continue;
      ++tried;
      if (!bench.reported(bench.with(i, "")).empty()) continue;
      ++taken;
      const bool named = std::ranges::any_of(harmless, [&](const std::string& begin) { return piece.starts_with(begin); });
      EXPECT_TRUE(named) << machine << ", piece " << i << ": " << piece.substr(0, 40);
    }
    EXPECT_GT(tried, 18u) << machine;
    EXPECT_LT(taken * 2, tried) << machine;
  }
}

/// The lines that come if one number of a line is greater by 1, but for that of a command and a speed; times tell speeds.
std::vector<std::string> greater_by_one(const std::string& line) {
  std::vector<std::string> changed;
  for (std::size_t at = line.find(' '); at != std::string::npos; at = line.find(' ', at + 1)) {
    const std::size_t end = line.find_first_of(" \n", at + 1);
    if (line[at + 1] == 'F') continue;
    const double value = std::stod(line.substr(at + 2, end - at - 2));
    changed.push_back(line.substr(0, at + 2) + fmt::format("{:.4f}", value + 1) + line.substr(end));
  }
  return changed;
}

TEST(Tampering, OtherNumbersAreReported) {
  for (const char* machine : {"nuferbj", "hp45", "oasis", "reprap-inkjet"}) {
    const TamperBench bench(machine);
    std::size_t tried = 0;
    for (std::size_t i = 0; i < bench.pieces.size(); ++i) {
      const std::string& line = bench.pieces[i];
      if ((line[0] != 'G' && line[0] != 'M') || line.starts_with("M117")) continue;
      for (const std::string& other : greater_by_one(line)) {
        EXPECT_NE(bench.reported(bench.with(i, other)), "") << machine << ": " << other;
        ++tried;
      }
    }
    EXPECT_GT(tried, 20u) << machine;
  }
}

// 16 um, or 64 of what is counted, in the second byte of each number.
TEST(Tampering, OtherNumbersOfRecordsAreReported) {
  for (const char* machine : {"xaar128-raw", "jet1000", "jet1000-grey"}) {
    const TamperBench bench(machine);
    for (std::size_t i = 0; i < bench.pieces.size(); ++i) {
      for (std::size_t at = 1; at < bench.head_bytes(bench.pieces[i]); at += 4) {
        std::string other = bench.pieces[i];
        other[at] = static_cast<char>(other[at] ^ 64);
        EXPECT_NE(bench.reported(bench.with(i, other)), "") << machine << ", piece " << i << ", byte " << at;
      }
    }
  }
}

}  // namespace
}  // namespace lamina
