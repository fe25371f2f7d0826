// Head and powder maintenance in programs: what is written is valid, and omitted or misplaced maintenance is reported.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/job/profiles/printer.h"
#include "pipeline/machine/profiles.h"
#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/runs.h"
#include "stages/program/dialect.h"
#include "stages/replay/machine.h"
#include "stages/replay/totals.h"
#include "tests/program/machines.h"
#include "tests/replay/maintenance_bench.h"
#include "tests/replay/printed_parts.h"

namespace lamina {
namespace {

using printed_parts::MaintenanceBench;

/// Of each dialect that fires off the bed: the line of a shot.
const struct {
  const char *machine, *shot;
} kDialects[] = {{"nuferbj", "M816 N40"}, {"hp45", "PRM o"}, {"oasis", "PRM o"}, {"reprap-inkjet", "M578 S4095"}};

TEST(Maintenance, WhatIsWrittenIsFoundAndWhatIsLeftOutIsReported) {
  for (const auto& [machine, shot] : kDialects) {
    SCOPED_TRACE(machine);
    const MaintenanceBench bench(machine);
    const auto count = bench.count(bench.program.text);
    ASSERT_TRUE(count.ok()) << count.error().message;
    EXPECT_EQ(count->spits, 1u);
    EXPECT_EQ(count->wipes, 1u);
    const Machine& m = bench.resolved.machine;
    EXPECT_EQ(count->spat, 40u * (m.head.nozzles - m.head.blocked.size()));
    const bool drop_by_drop = bench.resolved.machine.dialect == "m578";
    EXPECT_NE(
        bench.fault(bench.with(shot, "")).find(drop_by_drop ? "39 drops off the bed" : "before the head is fired off the bed"),
        std::string::npos);
    const std::string wipe = fmt::format("G1 X-45.0000 Y-12.0000 F{:.0f}\n", m.maintenance.wipe_speed_mm_s * 60);
    EXPECT_NE(bench.fault(bench.with(wipe, "")).find("before the head is wiped"), std::string::npos);
    const std::string spat = "X-45.0000 Y-10.0000";
    std::string text = bench.program.text;
    text.replace(text.find(spat), spat.size(), "X20.0000 Y10.0000");
    EXPECT_NE(bench.fault(text), "");
  }
}

TEST(Maintenance, LayersThatAreNotDueHaveNone) {
  for (const auto& [machine, shot] : kDialects) {
    const MaintenanceBench bench(machine, [](Machine& m) { m.maintenance.spit_layers = m.maintenance.wipe_layers = 3; });
    const auto count = bench.count(bench.program.text);
    ASSERT_TRUE(count.ok()) << machine << count.error().message;
    EXPECT_EQ(count->spits + count->wipes, 0u) << machine;
  }
}

// nuferbj with sweeps of 5 mm/s, of which one takes some 8 s: for any limit, no sweep ends later, and as few are made as
// that takes but for 3 % of room.
TEST(Maintenance, NoSweepEndsLaterThanTheLimitOfSeconds) {
  for (const char* machine : {"nuferbj", "hp45", "oasis"}) {
    std::uint32_t before = UINT32_MAX;
    for (const double limit : {21.0, 26.0, 41.0, 90.0}) {
      const MaintenanceBench bench(machine, [&](Machine& m) {
        m.bed.size_mm = {60, 60};
        m.motion.scan_speed_mm_s = m.dialect == "nuferbj" ? 10 : 26;
        m.motion.travel_speed_mm_s = 60;
        m.maintenance.spit_layers = m.maintenance.wipe_layers = 0;
        m.maintenance.spit_seconds = limit;
        m.maintenance.wipe_seconds = 2 * limit;
      });
      const auto count = bench.count(bench.program.text);
      ASSERT_TRUE(count.ok()) << machine << " " << limit << ": " << count.error().message;
      EXPECT_LE(count->spits, before) << machine;
      EXPECT_GE(count->spits, 1u);
      EXPECT_GE(count->wipes, 1u);
      before = count->spits;
      if (count->spits < 2) continue;
      const char* shot = bench.resolved.machine.dialect == "nuferbj" ? "M816" : "PRM";
      const std::string fault = bench.fault(bench.with(shot, "", 1));
      EXPECT_NE(fault.find("after the head was fired off the bed"), std::string::npos) << machine << limit << fault;
    }
  }
}

// Two clocks at a time, one's errand taking time of the other's, and a head that has to gain its speed.
TEST(Maintenance, BothClocksAreKeptRegardlessOfTheirLimits) {
  program::testing::Random random(18);
  std::uint32_t spits = 0, wipes = 0;
  for (int round = 0; round < 60; ++round) {
    const MaintenanceBench bench("nuferbj", [&](Machine& m) {
      m.bed.size_mm = {30, 90};
      m.motion.scan_speed_mm_s = 8.34;
      m.motion.travel_speed_mm_s = 60 + random() % 50;
      m.motion.acceleration_mm_s2 = round % 2 == 0 ? 0 : 20 + random() % 500;
      m.motion.both_directions = random() % 2 == 0;
      m.maintenance.spit_layers = m.maintenance.wipe_layers = 0;
      m.maintenance.spit_drops = 4000;
      m.maintenance.spit_seconds = 30 + random() % 30;
      m.maintenance.wipe_seconds = 34 + random() % 60;
    });
    const auto count = bench.count(bench.program.text);
    ASSERT_TRUE(count.ok()) << round << ": " << count.error().message;
    spits += count->spits;
    wipes += count->wipes;
  }
  EXPECT_GT(spits, 120u);
  EXPECT_GT(wipes, 60u);
}

TEST(Maintenance, ShotsElsewhereOrOnTheBedAreFound) {
  const MaintenanceBench bench("nuferbj");
  EXPECT_NE(bench.fault(bench.with("M816", "G0 X65.0000 Y12.0000 F1000\nM816 N40\n")).find("not at -45, -10"),
            std::string::npos);
  for (const char* drops : {"M816 N39\n", "M816 N41\n", "M816 N40\nM816 N40\n"}) {
    EXPECT_NE(bench.fault(bench.with("M816", drops)).find("drops off the bed, where 40 are a shot"), std::string::npos)
        << drops;
  }
  // The profile itself defines a position over the bed: any reader finds it, also in a profile by another writer.
  MaintenanceBench wrong("nuferbj");
  wrong.resolved.machine.maintenance.spit_mm = {{65, 12}};
  const std::string text = wrong.with("G0 X-45.0000 Y-10.0000", "G0 X65.0000 Y12.0000 F24000\n");
  EXPECT_NE(wrong.fault(text).find("fires off the bed where column"), std::string::npos) << wrong.fault(text);
  // And a profile without any takes no shot.
  wrong.resolved.machine.maintenance = {};
  EXPECT_NE(wrong.fault(text).find("the profile has no position for it"), std::string::npos) << wrong.fault(text);
}

TEST(Maintenance, PausesToDryAreBehindTheSweepsAtTheCapAndAsLongAsStated) {
  for (const char* machine : {"nuferbj", "oasis", "reprap-inkjet"}) {
    SCOPED_TRACE(machine);
    const MaintenanceBench bench(machine, [](Machine& m) {
      m.powder.dry_s = 2.5;
      m.maintenance.cap_mm = {{-45, -10}};
    });
    const double wet = MaintenanceBench(machine).count(MaintenanceBench(machine).program.text)->seconds();
    const auto count = bench.count(bench.program.text);
    ASSERT_TRUE(count.ok()) << count.error().message;
    EXPECT_GT(count->seconds(), wet + 2.5);
    const std::string pause = bench.resolved.machine.dialect == "oasis" ? "G4 P2.5" : "G4 P2500";
    EXPECT_NE(bench.fault(bench.with(pause, "")).find("the layer dries for 0 s where 2.5 have to be"), std::string::npos);
    const std::string spat = bench.resolved.machine.dialect == "m578" ? "M578" : "M812";
    if (bench.resolved.machine.dialect == "oasis") continue;
    EXPECT_NE(bench.fault(bench.with(spat, pause + "\n")), "");
  }
}

// A lamp around the pause to dry, a pump behind the wiper: exactly the profile's lines, in whole blocks, where they belong.
TEST(Maintenance, LinesOfTheMachinesOwnAreWhereTheProfileHasThem) {
  for (const char* machine : {"nuferbj", "oasis", "reprap-inkjet"}) {
    SCOPED_TRACE(machine);
    const MaintenanceBench bench(machine, [](Machine& m) {
      m.powder.dry_s = 2.5;
      m.powder.dry_on_lines = {"M106 S255"};
      m.powder.dry_off_lines = {"M107"};
      m.maintenance.wipe_lines = {"M42 P4 S1", "M42 P4 S0"};
    });
    EXPECT_EQ(bench.fault(bench.program.text), "");
    EXPECT_NE(bench.program.text.find("M42 P4 S1\nM42 P4 S0\n"), std::string::npos);
    for (const char* line : {"M106", "M107", "M42 P4 S1", "M42 P4 S0"})
      EXPECT_NE(bench.fault(bench.with(line, "")), "") << line;
    EXPECT_NE(bench.fault(bench.with("M106", "M106 S254\n")), "");
    EXPECT_NE(bench.fault(bench.with("M107", "M107\nM107\n")), "");
    EXPECT_NE(bench.fault(bench.with("M42 P4 S0", "M42 P4 S0\nM42 P4 S1\n")), "");
    const std::string first = bench.program.text.substr(0, bench.program.text.find('\n') + 1);
    EXPECT_NE(bench.fault(first + "M106 S255\n" + bench.program.text.substr(first.size())), "");
  }
}

/// What a layer without anything says of its program, as it is written.
Result<replay::Count> of_empty_layer(const MaintenanceBench& bench) {
  const PixelGrid& grid = bench.resolved.grid.image;
  const Runs empty = program::testing::runs_of(program::testing::Image(grid.rows(), std::vector<int>(grid.columns(), 0)));
  return printed_parts::verified(bench.resolved, empty, printed_parts::program_of(bench.resolved, empty));
}

// The head wipes, has nothing to sweep, and dries where it stands: the lamp's lines are not the wiper's.
TEST(Maintenance, TheCapMayBeWhereTheWiperEnds) {
  for (const char* machine : {"nuferbj", "oasis", "reprap-inkjet"}) {
    for (const bool spits : {false, true}) {
      const MaintenanceBench bench(machine, [&](Machine& m) {
        m.powder.dry_s = 2;
        m.powder.dry_on_lines = {"M106 S255"};
        m.maintenance.cap_mm = {{-45, -12}};
        m.maintenance.spit_mm = {{-45, -12}};
        m.maintenance.spit_layers = spits ? 7 : 0;
      });
      const auto count = of_empty_layer(bench);
      ASSERT_TRUE(count.ok()) << machine << spits << ": " << count.error().message;
      EXPECT_EQ(count->wipes, 1u);
    }
  }
}

// Layer 7 fires and does not wipe; its travel from the safe place to the shot is the way over the wiper.
TEST(Maintenance, TravelsOverTheWiperAreNoWipes) {
  for (const char* machine : {"nuferbj", "hp45", "oasis", "reprap-inkjet"}) {
    const auto change = [](Machine& m) {
      m.maintenance.wipe_layers = 5;
      m.maintenance.wipe_speed_mm_s = 33.3;
      m.motion.safe_mm = {-45, -30};
      m.maintenance.spit_mm = {{-45, -10}};
      m.maintenance.wipe_mm = {{-45, -30, -45, -10}};
      if (m.dialect == "oasis") m.powder.roller_mm[0] = m.powder.roller_axis == m.motion.x_axis ? -45 : -30;
    };
    const MaintenanceBench bench(machine, change);
    const auto count = bench.count(bench.program.text);
    ASSERT_TRUE(count.ok()) << machine << ": " << count.error().message;
    EXPECT_EQ(count->wipes, 0u) << machine;
    EXPECT_EQ(count->spits, 1u) << machine;
    Machine m = bench.resolved.machine;
    m.maintenance.wipe_speed_mm_s = m.motion.travel_speed_mm_s;
    const auto resolved = pipeline::resolve_profile(m);
    ASSERT_FALSE(resolved.ok()) << machine;
    EXPECT_NE(resolved.error().message.find("maintenance.wipe_mm: the head travels there as fast anyway"), std::string::npos)
        << resolved.error().message;
  }
}

TEST(Maintenance, AShotFollowsEachWipeAndVatsAreFilledOnce) {
  const MaintenanceBench bench("nuferbj", [](Machine& m) {
    m.powder.vat_depth_mm = {20, 20};
    m.powder.refill = VatRefill::kPause;
  });
  std::string text = bench.program.text;
  const std::size_t wipe = text.find("G0 X-45.0000 Y-30.0000"), shot = text.find("G0 X-45.0000 Y-10.0000");
  const std::string wiping = text.substr(wipe, shot - wipe);
  text.insert(text.find('\n', text.find("M816")) + 1, wiping);
  EXPECT_NE(bench.fault(text).find("scans after the wiper before the head is fired off the bed"), std::string::npos);
  const std::string first = bench.program.text.substr(0, bench.program.text.find('\n') + 1);
  const std::string rest = bench.program.text.substr(first.size());
  EXPECT_EQ(bench.fault(first + "M815\n" + rest), "");
  EXPECT_NE(bench.fault(first + "M815\nM815\n" + rest).find("filled a second time"), std::string::npos);
}

// G-code has no exponents: turns and pauses are spelt plainly, to a thousandth.
TEST(Maintenance, NumbersOfCommandsArePlain) {
  for (const char* machine : {"nuferbj", "oasis"}) {
    const MaintenanceBench bench(machine, [](Machine& m) {
      m.powder.roller_rpm = 1e5 / 3;
      m.powder.dry_s = 0.1 + 0.2;
    });
    EXPECT_EQ(bench.fault(bench.program.text), "");
    EXPECT_NE(bench.program.text.find("M4 S33333.333\n"), std::string::npos);
    EXPECT_NE(bench.program.text.find(bench.resolved.machine.dialect == "oasis" ? "G4 P0.3\n" : "G4 P300\n"),
              std::string::npos);
    const std::string fault = bench.fault(bench.with("M4 S", "M4 S3.3333333e4\n"));
    EXPECT_NE(fault.find("'S3.3333333e4' is no word"), std::string::npos) << fault;
  }
}

TEST(Maintenance, TheRollersSpeedIsWrittenAndHeld) {
  for (const char* machine : {"nuferbj", "oasis"}) {
    const MaintenanceBench bench(machine, [](Machine& m) { m.powder.roller_rpm = 350; });
    EXPECT_EQ(bench.fault(bench.program.text), "");
    EXPECT_NE(bench.fault(bench.with("M5", "")), "");
    if (bench.resolved.machine.dialect == "nuferbj") {
      EXPECT_NE(bench.fault(bench.with("M5", "")).find("the roller returns with 350 turns"), std::string::npos);
    }
    EXPECT_NE(bench.fault(bench.with("M4 S350", "M4 S300\n")).find("300 turns a minute where 350 have to be"),
              std::string::npos);
  }
  const MaintenanceBench none("oasis");
  EXPECT_NE(none.fault(none.with("M4", "M4 S300\n")).find("M4 must not have S"), std::string::npos);
}

// The first layer of 0.1 mm over a base of 3 x 0.2 mm: 0.7 mm fed in four turns, and a turn that is left out or fed from too
// low a vat is found by its number.
TEST(Maintenance, TheBaseIsSpreadLayerByLayerBelowTheFirst) {
  const Layer first{0, 0, 100'000, LayerReason::kUniform};
  for (const auto& [machine, shot] : kDialects) {
    SCOPED_TRACE(machine);
    const MaintenanceBench bench(machine, [](Machine& m) {
      m.maintenance = {};
      m.powder.base_layers = 3;
      m.powder.base_layer_mm = 0.2;
    });
    const Machine& m = bench.resolved.machine;
    program::ProgramBytes bytes;
    const auto writer = program::find_dialect(m.dialect)->make_writer(m, bench.resolved.grid);
    LayerCycle cycle;
    cycle.layers = 9;
    cycle.thickness_nm = first.thickness;
    writer->begin_layer(cycle, bytes);
    writer->end_layer(cycle, bytes);
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const PixelGrid& grid = bench.resolved.grid.image;
    const Runs empty = program::testing::runs_of(program::testing::Image(grid.rows(), std::vector<int>(grid.columns(), 0)));
    const auto virtual_machine = replay::VirtualMachine::build(m, grid.columns(), grid.rows());
    const auto fault = [&](const std::string& program) {
      const auto count = virtual_machine->replay(program, first, empty, 0, 0);
      return count.ok() ? std::string() : count.error().message;
    };
    const auto count = virtual_machine->replay(text, first, empty, 0, 0);
    ASSERT_TRUE(count.ok()) << count.error().message << text;
    EXPECT_NEAR(count->fed_mm[0], m.powder.dose * 0.7, 1e-6);
    EXPECT_NEAR(count->build_mm, 0.1, 1e-6);
    const std::string far = fmt::format("G1 {}{:.4f} ", m.powder.roller_axis, m.powder.roller_mm[1]);
    std::string without = text;
    for (std::size_t at = without.find(far); at != std::string::npos; at = std::string::npos) {
      without.erase(at, without.find('\n', at) + 1 - at);
    }
    EXPECT_NE(fault(without).find("powder cycle: "), std::string::npos) << fault(without);
    const std::string feed = fmt::format("G1 {}{:.4f} ", m.powder.feed_axes[0], m.powder.feed_sign * m.powder.dose * 0.2);
    if (m.dialect == "oasis") continue;  // feeds in several movements
    std::string later = text;
    const std::size_t second = later.find(feed, later.find(feed) + 1);
    const std::string line = later.substr(second, later.find('\n', second) + 1 - second);
    later.erase(second, line.size());
    later.insert(later.find(feed, second), line);
    EXPECT_NE(fault(later).find("layer 2 of the base is spread"), std::string::npos) << fault(later);
  }
}

// What a program cannot say, or a machine cannot do, is refused with its key.
TEST(Maintenance, ProfilesThatCannotBeKeptAreRefused) {
  const struct {
    const char *machine, *key;
    std::function<void(Machine&)> change;
  } rows[] = {
      {"nuferbj", "maintenance.spit_mm: is missing", [](Machine& m) { m.maintenance.spit_layers = 1; }},
      {"nuferbj", "maintenance.wipe_mm: is missing", [](Machine& m) { m.maintenance.wipe_seconds = 9; }},
      {"nuferbj", "maintenance.spit_mm: nozzles are over the bed",
       [](Machine& m) {
         m.maintenance.spit_layers = 1, m.maintenance.spit_mm = {{65, 12}};
       }},
      {"nuferbj", "maintenance.cap_mm: nozzles are over the bed",
       [](Machine& m) {
         m.maintenance.cap_mm = {{70, 60}};
       }},
      {"nuferbj", "maintenance.wipe_mm: nozzles are over the bed",
       [](Machine& m) {
         m.maintenance.wipe_layers = 1, m.maintenance.wipe_mm = {{-45, 12, 250, 12}};
       }},
      {"nuferbj", "maintenance.wipe_mm: the head does not move",
       [](Machine& m) {
         m.maintenance.wipe_layers = 1, m.maintenance.wipe_mm = {{-45, 12, -45, 12}};
       }},
      {"nuferbj", "maintenance.spit_seconds: 0.5 s, and a sweep ends up to",
       [](Machine& m) {
         m.maintenance.spit_seconds = 0.5, m.maintenance.spit_mm = {{-45, 0}};
       }},
      {"nuferbj", "powder.refill: pauses need powder.vat_depth_mm", [](Machine& m) { m.powder.refill = VatRefill::kPause; }},
      {"nuferbj", "maintenance.wipe_lines: M816 is a command of programs",
       [](Machine& m) { m.maintenance.wipe_lines = {"M816 N4"}; }},
      {"nuferbj", "powder.dry_off_lines: there is no pause", [](Machine& m) { m.powder.dry_off_lines = {"M107"}; }},
      {"nuferbj", "powder.dry_off_lines: M812 is a command of programs",
       [](Machine& m) {
         m.powder.dry_s = 1, m.powder.dry_off_lines = {"M107", "M812"};
       }},
      {"oasis", "powder.dry_on_lines: M02: give the command's number",
       [](Machine& m) { m.powder.dry_s = 1, m.powder.dry_on_lines = {"M02"}; }},
      {"oasis", "powder.dry_on_lines: M00: give the command's number",
       [](Machine& m) { m.powder.dry_s = 1, m.powder.dry_on_lines = {"M00"}; }},
      {"reprap-inkjet", "powder.dry_on_lines: M112.0: give the command's number",
       [](Machine& m) { m.powder.dry_s = 1, m.powder.dry_on_lines = {"M112.0"}; }},
      {"reprap-inkjet", "maintenance.wipe_lines: M+2: give the command's number",
       [](Machine& m) { m.maintenance.wipe_lines = {"M+2"}; }},
      {"nuferbj", "powder.dry_s: 0.0004 is written as 0", [](Machine& m) { m.powder.dry_s = 4e-4; }},
      {"nuferbj", "powder.roller_rpm: 1e-05 is written as 0", [](Machine& m) { m.powder.roller_rpm = 1e-5; }},
      {"brundlefab", "maintenance.spit_mm: the ink bar runs from its home along Y; give 0 for y",
       [](Machine& m) {
         m.maintenance.spit_seconds = 9, m.maintenance.spit_mm = {{400, 5}};
       }},
      {"brundlefab", "maintenance.spit_mm: the bar runs over the bed at x",
       [](Machine& m) {
         m.maintenance.spit_layers = 1, m.maintenance.spit_mm = {{300, 0}};
       }},
      {"brundlefab", "maintenance.spit_mm: the pen reaches x 195 to 845 mm",
       [](Machine& m) {
         m.maintenance.spit_layers = 1, m.maintenance.spit_mm = {{850, 0}};
       }},
      {"brundlefab", "maintenance.spit_seconds: 9 s, and a band ends up to",
       [](Machine& m) {
         m.maintenance.spit_seconds = 9, m.maintenance.spit_mm = {{400, 0}};
       }},
      {"brundlefab", "bed.build_height_mm, powder.dose: the bins move by 140 mm",
       [](Machine& m) { m.powder.base_layers = 30, m.powder.base_layer_mm = 0.2; }},
      {"brundlefab", "powder.refill: programs",
       [](Machine& m) {
         m.powder.refill = VatRefill::kPause, m.powder.vat_depth_mm = {100, 0};
       }},
      {"brundlefab", "powder.dry_s: programs", [](Machine& m) { m.powder.dry_s = 1; }},
      {"brundlefab", "maintenance.cap_mm: programs",
       [](Machine& m) {
         m.maintenance.cap_mm = {{400, 0}};
       }},
      {"xaar128-raw", "maintenance.wipe_mm: raw has positions up to 2147 mm",
       [](Machine& m) {
         m.maintenance.wipe_layers = 1, m.maintenance.wipe_mm = {{-3000, 5, -3000, 50}};
       }},
      {"jet1000", "maintenance.spit_mm: nozzles are over the bed",
       [](Machine& m) {
         m.maintenance.spit_layers = 1, m.maintenance.spit_mm = {{50, 50}};
       }},
      {"brundlefab", "maintenance.wipe_seconds: programs", [](Machine& m) { m.maintenance.wipe_seconds = 9; }},
      {"hp45", "maintenance.wipe_lines: programs of the dialect hp45",
       [](Machine& m) { m.maintenance.wipe_lines = {"M42 P4 S1"}; }},
      {"hp45", "powder.dry_s: programs of the dialect hp45 cannot say it", [](Machine& m) { m.powder.dry_s = 1; }},
      {"hp45", "powder.roller_rpm: ", [](Machine& m) { m.powder.roller_rpm = 100; }},
      {"reprap-inkjet", "maintenance.spit_seconds: 6 s, and a sweep ends up to",
       [](Machine& m) {
         m.maintenance.spit_seconds = 6, m.maintenance.spit_mm = {{-45, 0}};
       }},
      {"reprap-inkjet", "powder.roller_rpm: programs", [](Machine& m) { m.powder.roller_rpm = 1; }},
      {"xaar128-raw", "powder.refill: pauses need powder.vat_depth_mm",
       [](Machine& m) { m.powder.refill = VatRefill::kPause; }},
  };
  for (const auto& [machine, key, change] : rows) {
    Machine m = *pipeline::find_machine(machine);
    change(m);
    const auto resolved = pipeline::resolve_profile(m);
    ASSERT_FALSE(resolved.ok()) << machine << " " << key;
    EXPECT_NE(resolved.error().message.find(key), std::string::npos) << machine << ": " << resolved.error().message;
    EXPECT_EQ(resolved.error().fault, Fault::kUsage);
  }
}

TEST(Maintenance, EveryKeyIsReadAndKept) {
  const std::string text =
      "[machine]\nname = \"kept\"\n[powder]\nvat_depth_mm = [120, 80.5]\nrefill = \"pause\"\nbase_layers = 7\nbase_layer_mm = 0.15\n"
      "dry_s = 2.5\ndry_on_lines = [\"M106 S255\", \"M42 P-4 S0.5\"]\ndry_off_lines = [\"M107\"]\nroller_rpm = 350\n"
      "[maintenance]\nspit_layers = 3\nspit_seconds = 12.5\nspit_drops = 33\nspit_mm = [-40, 5.5]\nwipe_layers = 9\nwipe_seconds = 60\n"
      "wipe_mm = [-40, 20, -40, 60]\nwipe_speed_mm_s = 25\nwipe_lines = [\"M42 P4 S1\"]\ncap_mm = [-45, 5]\n";
  const auto machine = pipeline::read_machine(text, "kept.toml");
  ASSERT_TRUE(machine.ok()) << machine.error().message;
  const std::string kept = pipeline::kept_machine_text(*machine);
  const std::string tail = text.substr(text.find("vat_depth_mm"));
  std::string lines = kept.substr(kept.find("vat_depth_mm")), wanted = tail;
  std::erase(lines, '\n');
  std::erase(wanted, '\n');
  EXPECT_EQ(lines, wanted);
  EXPECT_EQ(pipeline::kept_machine_text(*pipeline::read_machine(kept, "again.toml")), kept);
  for (const char* line : {"G1 X3", "M42 p4", "M42  P4", "M", "42", "M42 P4;S1", "M42 Pnan"}) {
    const auto wrong =
        pipeline::read_machine(fmt::format("[machine]\nname = \"a\"\n[maintenance]\nwipe_lines = [\"{}\"]\n", line), "a.toml");
    ASSERT_FALSE(wrong.ok()) << line;
    EXPECT_NE(wrong.error().message.find("is no command such as M42 P4 S1"), std::string::npos) << wrong.error().message;
  }
}

// 2 mm of depth, layers that take 0.5: four, and the fifth has none; both vats are filled by a pause.
TEST(Maintenance, VatsAreEmptiedAndFilledByWhatProgramsFeed) {
  Machine machine;
  machine.powder.vat_depth_mm = {2, 0};
  replay::VatLevels levels(machine);
  replay::Count count;
  count.fed_mm = {0.5, 7};
  for (std::uint32_t layer = 0; layer < 4; ++layer) EXPECT_TRUE(levels.take(layer, count).ok());
  EXPECT_EQ(levels.take(4, count).error().message, "layer 4: takes 0.5 mm of the first vat, where 0 of 2 are left");
  EXPECT_TRUE(levels.take(5, count).ok()) << "once";
  // A layer that could not be carried out, or that is of a shard elsewhere, may have filled them.
  for (const bool missing : {false, true}) {
    replay::VatLevels unsure(machine);
    for (std::uint32_t layer = 0; layer < 10; ++layer) {
      count.refills = layer == 5 ? 1 : 0;
      if (layer == 2 && missing) continue;
      const Status taken = unsure.take(layer, layer == 2 ? std::nullopt : std::optional(count));
      EXPECT_EQ(taken ? "" : taken.error().message,
                layer == 9 ? "layer 9: takes 0.5 mm of the first vat, where 0 of 2 are left" : "")
          << layer;
    }
  }
  replay::VatLevels filled(machine);
  for (std::uint32_t layer = 0; layer < 12; ++layer) {
    count.refills = layer == 4 || layer == 8 ? 1 : 0;
    EXPECT_TRUE(filled.take(layer, count).ok()) << layer;
  }
}

}  // namespace
}  // namespace lamina
