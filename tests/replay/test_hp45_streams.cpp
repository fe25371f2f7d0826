// The HP45 controller alone, by lines and movements that no host sends: the decoder against the port, and the author's example.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <tuple>

#include "stages/replay/hp45/controller.h"
#include "tests/replay/hp45_bench.h"

namespace lamina::hp45_bench {
namespace {

// The example at the head of HP45_Standalone_V4.ino: a quarter of the nozzles for 10 mm each.
TEST(Hp45, AuthorsExampleFiresAQuarterOfTheNozzlesForTenMillimetresEach) {
  Machine machine = shipped_by_name("hp45");
  machine.mounting.offset_mm = {0, 0};
  const ResolvedMachine resolved = *resolve_profile(machine);
  Machine bare = machine;
  bare.head.blocked = {};
  const std::string off(50, 'A');
  const std::string program =
      "SPME\nSER JY\nSDP JY\nSDN Bk\nSSID A\nBMOD A\nBCL\nG1 X-20.32 Y" +
      std::to_string(resolved.grid.line_position_nm(0) / 1e6) +
      " F15000\nG4 P0\nSEP -E9g\n"
      "SBR A " +
      off +
      "\nSBR CcQ ////////////HAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA\n"
      "SBR E4g AAAAAAAAAAAA4////////////AAAAAAAAAAAAAAAAAAAAAAAAA\nSBR HUw AAAAAAAAAAAAAAAAAAAAAAAA////////////HAAAAAAAAAAAA\n"
      "SBR JxA AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA4////////////\nSBR MNQ " +
      off + "\nG1 X70 F15000\nG4 P0\nBRL\n";
  const auto virtual_machine = *replay::VirtualMachine::build(bare, resolved.grid.image.columns(), resolved.grid.image.rows());
  std::map<std::uint32_t, std::set<std::uint32_t>> nozzles;  // at each step
  // 75 less those that have no channel of their own: 243, 293 and 299, 170, 172 and 184, 132, 8, 36 and 43.
  constexpr std::size_t kFire[] = {0, 72, 72, 74, 72};
  const auto count = virtual_machine.run(
      program, 7, [&](const replay::VirtualMachine::Drop& drop) { nozzles[drop.step].insert(drop.nozzle); });
  ASSERT_TRUE(count.ok()) << count.error().message;
  for (std::uint32_t step = 0; step < 1300; ++step) {
    const double at = (step + 0.5) * 25.4 / 600;                    // mm
    if (std::abs(at / 10 - std::round(at / 10)) < 0.005) continue;  // a count of the encoder
    EXPECT_EQ(nozzles.count(step) != 0 ? nozzles[step].size() : 0u, at > 10 && at < 50 ? kFire[static_cast<int>(at / 10)] : 0u)
        << at;
  }
}

/// What a row shows at a point between the counts of the encoder: row, point, nozzles.
using Shown = std::tuple<int, std::int64_t, std::string>;

/// The decoder's controller, fed as the port is; lines that it refuses are left out of the text.
class Hp45Stream {
 public:
  std::string text = "SER JY\n";
  std::vector<Shown> shown;

  void say(const std::string& command, const std::string& rest) {
    if (controller_.execute(command, rest).ok()) text += command + " " + rest + "\n";
  }
  void go(std::int64_t counts) {
    text += fmt::format("G1 X{:.6f} F15000\nG4 P0\n", static_cast<double>(counts) * 25.4 / 600);
    controller_.move(static_cast<double>(counts) * kCountUm, [&](const replay::hp45::Controller::Firing& firing) {
      const double minimum = std::min(firing.from_um, firing.to_um), maximum = std::max(firing.from_um, firing.to_um);
      for (auto k = static_cast<std::int64_t>(std::ceil(minimum / kCountUm));
           firing.steady && static_cast<double>(k) * kCountUm < maximum; ++k) {
        std::string nozzles;
        for (std::uint32_t position = 0; position < 300; ++position) {
          nozzles += ((*firing.burst)[position / 64] >> (63 - position % 64) & 1) != 0 ? '1' : '0';
        }
        shown.emplace_back(static_cast<int>(firing.row), k, nozzles);
      }
    });
  }
  static constexpr double kCountUm = 25'400.0 / 600;

 private:
  replay::hp45::Controller controller_;
};

std::string in_base64(std::int64_t value) {
  static const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::int64_t left = std::abs(value); left != 0 || text.empty(); left /= 64)
    text.insert(0, 1, digits[static_cast<std::size_t>(left % 64)]);
  return (value < 0 ? "-" : "") + text;
}

// Ways of an idle controller are not walked count by count: 4,000 of 2 km, which are 1.9e11 counts. Behind them it fires as
// behind a short one of the same counts, modulo the 50 that a measure of speed takes.
TEST(Hp45, LongPathsOfAnIdleControllerChangeNothing) {
  const auto fired = [](std::int64_t counts, int times) {
    replay::hp45::Controller controller;
    std::string detected;
    const auto watch = [&](const replay::hp45::Controller::Firing& firing) {
      detected += fmt::format("{} {} {:.3f} {:.3f} {}\n", firing.row, firing.line, firing.from_um, firing.to_um, firing.steady);
    };
    for (int i = 0; i < times; ++i) {
      controller.move(static_cast<double>(counts) * Hp45Stream::kCountUm, watch);
      controller.move(0, watch);
    }
    EXPECT_TRUE(controller.execute("SER", "JY").ok());
    EXPECT_TRUE(controller.execute("SEP", "A").ok());
    for (const char* line : {"B9A ", "D6A ", "F3A "}) {
      const char nozzles = line[0] == 'D' ? 'B' : 'A';
      EXPECT_TRUE(controller.execute("SBR", line + std::string(50, nozzles)).ok());
    }
    controller.move(60'000, watch);
    return detected;
  };
  const std::string once = fired(150, 1);
  EXPECT_NE(once, "");
  EXPECT_EQ(fired(150 + 47'000'000, 2'000), once);
}

// Lines in any order, rewinds, clearings and movements to and fro: what no host sends either.
TEST(Hp45, DecoderAndPortAgreeOnRandomStreams) {
  std::size_t points = 0;
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    program::testing::Random random(seed);
    const auto below = [&](std::uint32_t maximum) { return static_cast<std::int64_t>(random() % maximum); };
    Hp45Stream stream;
    stream.go(below(800) - 400);
    for (int turn = 0; turn < 6; ++turn) {
      if (turn == 0 || below(3) == 0) stream.say("SEP", in_base64((below(600) - 300) * 127));  // a whole count is every 127 um
      if (below(2) == 0) stream.say("BCL", "");
      std::int64_t at = below(40'000) - 20'000;
      const std::int64_t pace = below(2) == 0 ? 1 : -1;
      for (std::int64_t line = below(12); line-- > 0; at += pace * below(4000) - (below(5) == 0 ? 3000 : 0)) {
        std::string nozzles(50, 'A');
        for (int set = 0; set < 4; ++set) nozzles[random() % 50] = static_cast<char>('B' + below(20));
        stream.say("SBR", in_base64(at) + " " + (below(4) == 0 ? std::string(50, 'A') : nozzles));
      }
      if (below(4) == 0) stream.say(below(2) == 0 ? "BRES" : "BCL", "");
      stream.go(below(1600) - 800);
    }
    firmware::Hp45Port port('X', 'Y', 0, Hp45Stream::kCountUm);
    port.tick_us = 10;
    port.run(stream.text);
    std::vector<Shown> shown;
    for (const auto& detected : port.shown) {
      if (detected.steady)
        shown.emplace_back(detected.row, std::llround(detected.along_um / Hp45Stream::kCountUm), detected.nozzles.to_string());
    }
    for (auto* one : {&shown, &stream.shown}) {
      std::stable_sort(one->begin(), one->end(),
                       [](const Shown& a, const Shown& b) { return std::get<0>(a) < std::get<0>(b); });
    }
    ASSERT_EQ(shown.size(), stream.shown.size()) << seed << "\n" << stream.text;
    EXPECT_TRUE(shown == stream.shown) << seed << "\n" << stream.text;
    points += shown.size();
  }
  EXPECT_GT(points, 10'000u);
}

}  // namespace
}  // namespace lamina::hp45_bench
