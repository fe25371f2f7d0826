// Programs for RepRapFirmware with inkjet support, carried out by its rules: by lamina's decoder and by a port of its own.
#include <gtest/gtest.h>

#include <charconv>
#include <map>

#include "tests/program/machines.h"
#include "tests/replay/printed_parts.h"

namespace lamina {
namespace {

using printed_parts::Program;

/// Drops outside of the image by GCodes::HandleMcode, case 578, and Platform::Inkjet: axis positions, S alone, 12 bits.
struct InkjetFaults {
  std::size_t missing = 0, added = 0, doubled = 0;
};

InkjetFaults inkjet_faults(std::string_view text, const RunsView& image) {
  double x = 0, y = 0;
  bool relative = false;
  std::map<std::pair<std::int64_t, std::int64_t>, int> fired;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    const auto number = [&](char letter, double& value) {
      const std::size_t at = line.find(std::string(" ") + letter);
      if (at == std::string_view::npos) return false;
      return std::from_chars(line.data() + at + 2, line.data() + line.size(), value).ec == std::errc();
    };
    if (line == "G90" || line == "G91") relative = line == "G91";
    if ((line.starts_with("G0 ") || line.starts_with("G1 ")) && !relative) {
      number('X', x);
      number('Y', y);
    }
    double bits = 0;
    if (!line.starts_with("M578 ") || !number('S', bits)) continue;
    for (int i = 0; i < 12; ++i) {
      if ((static_cast<std::int32_t>(bits) >> i & 1) == 0) continue;
      // Nozzle 0 is at the back, and y counts from the front.
      const double pixel = 25.4 / 96;
      ++fired[{std::llround(x / pixel - 0.5), image.rows() - 1 - std::llround(y / pixel - 0.5 - i)}];
    }
  }
  InkjetFaults found;
  std::size_t right = 0;
  for (const auto& [at, times] : fired) {
    (printed_parts::is_set(image, at.first, at.second) ? right : found.added) += 1;
    found.doubled += times > 1;
  }
  found.missing = set_pixels(image) - right;
  return found;
}

TEST(M578, TwelveLayersOfFivePartsAreFiredAndNothingElse) {
  std::size_t drops = 0, number = 0;
  for (const auto& part : printed_parts::kFiveParts) {
    const auto resolved = printed_parts::shipped("reprap-inkjet", [&](Machine& machine) {
      if (++number % 2 == 0) machine.head.blocked = {0, 7};
      machine.head.blocked_rule = number == 4 ? BlockedRule::kSecondPass : BlockedRule::kReport;
      machine.motion.both_directions = number == 3;
    });
    for (const Runs& image : printed_parts::twelve_layers(part.name, part.side_mm / 2, part.at_mm, resolved.grid.image)) {
      const Program program = printed_parts::program_of(resolved, image);
      const auto count = printed_parts::verified(resolved, image, program);
      ASSERT_TRUE(count.ok()) << part.name << ": " << count.error().message;
      const InkjetFaults found = inkjet_faults(program.text, image);
      EXPECT_EQ(found.missing, program.count.lost) << part.name;
      EXPECT_EQ(found.added, 0u) << part.name;
      EXPECT_EQ(found.doubled, 0u) << part.name;
      drops += count->drops;
    }
  }
  EXPECT_GT(drops, 50'000u);
}

// Without a ramp a sweep's first drop falls where its movement begins, regardless of the bits of the moves before it.
TEST(M578, SweepsWithoutARampAreFiredEitherWay) {
  for (int i = 0; i < 40; ++i) {
    const Side from = i % 2 == 0 ? Side::kLeft : Side::kRight;
    const auto resolved = printed_parts::shipped("reprap-inkjet", [&](Machine& machine) {
      machine.bed.size_mm = {40 * 25.4 / 96 - 1e-4, 50 * 25.4 / 96 - 1e-4};
      machine.mounting.scan_from = from;
      machine.motion.both_directions = true;
      machine.motion.ramp_mm = 0;
      machine.motion.safe_mm = {-3.3333 * i, -1.7 * i};
    });
    program::testing::Image image(50, std::vector<int>(40, 0));
    for (std::size_t r = 3; r < 40; ++r) {
      for (std::size_t c = r; c < 40; ++c) image[r][c] = 1;  // one column in the last row
    }
    const Runs runs = program::testing::runs_of(image);
    const auto count = printed_parts::verified(resolved, runs, printed_parts::program_of(resolved, runs));
    ASSERT_TRUE(count.ok()) << count.error().message;
    EXPECT_EQ(count->drops, set_pixels(runs));
  }
}

TEST(M578, ProgramsStateTheFirmwareThatTheyAreFor) {
  const auto resolved = printed_parts::shipped("reprap-inkjet", [](Machine&) {});
  program::ProgramBytes bytes;
  program::find_dialect("m578")->make_writer(resolved.machine, resolved.grid)->start(9, bytes);
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  EXPECT_NE(text.find("for RepRapFirmware 1.09r to 3.4 built with SUPPORT_INKJET\n"), std::string::npos) << text;
}

TEST(M578, AnotherHeadMoreNozzlesAndALaterFirmwareAreFound) {
  const auto resolved = printed_parts::shipped("reprap-inkjet", [](Machine& machine) {
    machine.bed.size_mm = {40 * 25.4 / 96 - 1e-4, 30 * 25.4 / 96 - 1e-4};
  });
  program::testing::Image image(30, std::vector<int>(40, 0));
  for (std::size_t r = 0; r < 12; ++r) {
    for (std::size_t c = 0; c < 40; ++c) image[r][c] = 1;
  }
  const Runs runs = program::testing::runs_of(image);
  const Program good = printed_parts::program_of(resolved, runs);
  ASSERT_TRUE(printed_parts::verified(resolved, runs, good).ok());
  const auto found = [&](const pipeline::ResolvedMachine& machine, const std::string& from, const std::string& to) {
    Program bad = good;
    const std::size_t at = bad.text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    if (at != std::string::npos) bad.text.replace(at, from.size(), to);
    const auto count = printed_parts::verified(machine, runs, bad);
    return count.ok() ? std::string() : count.error().message;
  };
  EXPECT_NE(found(resolved, "M578 S4095", "M578 P1 S4095").find("ignores P"), std::string::npos);
  EXPECT_NE(found(resolved, "M578 S4095", "M578 S8191").find("nozzles 0 to 11 alone"), std::string::npos);
  EXPECT_NE(found(resolved, "M578 S4095", "M578 S4094").find("not fired"), std::string::npos);
  EXPECT_NE(found(resolved, "M578 S4095\n", "").find("not fired"), std::string::npos);
  pipeline::ResolvedMachine later = resolved;
  later.machine.firmware = "3.5.1";
  EXPECT_NE(found(later, "M578 S4095", "M578 S4095").find("RepRapFirmware 3.5.1 has no M578"), std::string::npos);

  const auto refused = [](auto&& change) {
    Machine machine = *pipeline::find_machine("reprap-inkjet");
    change(machine);
    const auto made = pipeline::resolve_profile(machine);
    return made.ok() ? std::string() : made.error().message;
  };
  EXPECT_NE(refused([](Machine& m) { m.head.nozzles = 13; }).find("at most 12 nozzles"), std::string::npos);
  for (const std::string version : {"3.5", "3.5.0", "3.6", "4"}) {
    EXPECT_NE(refused([&](Machine& m) { m.firmware = version; }).find("has no M578; it was removed for 3.5"),
              std::string::npos);
  }
  for (const std::string version : {"v3.5.1", "RepRapFirmware 3.5"}) {
    EXPECT_NE(refused([&](Machine& m) { m.firmware = version; }).find("give RepRapFirmware's version alone"),
              std::string::npos);
    later.machine.firmware = version;
    EXPECT_NE(found(later, "M578 S4095", "M578 S4095").find("has no M578"), std::string::npos);
  }
  for (const std::string version : {"", "1.09r", "2.03", "3.4.6"}) {
    EXPECT_EQ(refused([&](Machine& m) { m.firmware = version; }), "");
  }
}

}  // namespace
}  // namespace lamina
