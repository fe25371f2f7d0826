// Care of head and powder where the host moves the machine: records of raw and planes by their READMEs, shots of the
// BrundleFab by the port of its firmware, and clocks of dialects whose sweeps are no even movement.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "stages/replay/time/timer.h"
#include "stages/replay/totals.h"
#include "tests/replay/brundlefab_port.h"
#include "tests/replay/maintenance_bench.h"

namespace lamina {
namespace {

using printed_parts::MaintenanceBench;

std::uint32_t number_at(const std::string& text, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value |= std::uint32_t{static_cast<std::uint8_t>(text[at + i])} << (8 * i);
  return value;
}

struct Record {
  std::string name;
  std::size_t at, bytes;
};

constexpr const char* kNames[] = {"GOTO", "FILL", "BASE", "ROLL", "WIPE", "SPIT", "DRYS", "LINE"};

/// The records of care of a layer, in their order, as the READMEs have them.
std::vector<Record> records_of(const std::string& text, bool planes, std::uint32_t nozzles) {
  std::vector<Record> found;
  std::size_t at = planes ? 8 + 4 * std::size_t{number_at(text, 4)} : 24;
  while (at + 8 <= text.size()) {
    const std::size_t size = 8 + 4 * std::size_t{number_at(text, at + 4)};
    const std::uint32_t command = number_at(text, at);
    const std::string tag = text.substr(at, 4);
    const auto name = std::ranges::find(kNames, tag, [](const char* n) { return std::string(n); });
    if (planes && command >= 0x4C10 && command < 0x4C18) {
      found.push_back({kNames[command - 0x4C10], at, size});
    } else if (!planes && name != std::end(kNames)) {
      found.push_back({*name, at, size});
    } else if (!planes && tag == "LEND") {
      break;
    } else if (!planes) {
      EXPECT_EQ(tag, "SWTH");
      std::uint32_t segments = number_at(text, at + 24);
      for (at += 28; segments > 0; --segments) at += 8 + std::size_t{number_at(text, at + 4)} * ((nozzles + 127) / 128 * 16);
      continue;
    }
    at += size;
  }
  return found;
}

/// All that raw and planes can say of a layer that is not the first.
void all_maintenance(Machine& m) {
  m.powder.dry_s = 2.5;
  m.powder.dry_on_lines = {"M106 S255"};
  m.powder.dry_off_lines = {"M107"};
  m.powder.roller_rpm = 350.5;
  m.maintenance.wipe_lines = {"M42 P4 S1", "M42 P4 S0"};
  m.maintenance.cap_mm = {{-45, -10}};
}

class MaintenanceRecords : public testing::TestWithParam<const char*> {
 protected:
  static bool planes(const MaintenanceBench& bench) { return bench.resolved.machine.dialect == "planes"; }
  static std::vector<Record> records(const MaintenanceBench& bench) {
    return records_of(bench.program.text, planes(bench), bench.resolved.grid.nozzles);
  }
  static std::string names(const MaintenanceBench& bench) {
    std::string all;
    for (const Record& record : records(bench)) all += record.name + " ";
    return all;
  }
};

TEST_P(MaintenanceRecords, AreWhatTheProfileRequestsInItsOrder) {
  const MaintenanceBench bench(GetParam(), all_maintenance);
  ASSERT_EQ(names(bench), "ROLL GOTO WIPE LINE LINE GOTO SPIT GOTO LINE DRYS LINE ");
  const auto all = records(bench);
  const std::string& text = bench.program.text;
  EXPECT_EQ(number_at(text, all[0].at + 8), 350'500u);
  EXPECT_EQ(static_cast<std::int32_t>(number_at(text, all[1].at + 8)), -45'000'000);
  EXPECT_EQ(static_cast<std::int32_t>(number_at(text, all[1].at + 12)), -30'000'000);
  EXPECT_EQ(static_cast<std::int32_t>(number_at(text, all[2].at + 12)), -12'000'000);
  EXPECT_EQ(number_at(text, all[2].at + 16), 50'000u);
  EXPECT_EQ(text.substr(all[3].at + 8, 9), "M42 P4 S1");
  EXPECT_EQ(number_at(text, all[6].at + 8), 40u);
  EXPECT_EQ(number_at(text, all[9].at + 8), 2500u);
  const auto count = bench.count(text);
  ASSERT_TRUE(count.ok()) << count.error().message;
  EXPECT_EQ(count->spits, 1u);
  EXPECT_EQ(count->wipes, 1u);
  EXPECT_EQ(count->spat, 40u * (bench.resolved.machine.head.nozzles - bench.resolved.machine.head.blocked.size()));
  // Without care the bytes are as ever.
  const MaintenanceBench none(GetParam(), [](Machine& m) { m.maintenance = {}; });
  EXPECT_EQ(names(none), "");
  const double shot = 40 / bench.resolved.machine.head.highest_frequency_hz;
  EXPECT_GT(count->seconds(), none.count(none.program.text)->seconds() + 2.5 + shot);
}

TEST_P(MaintenanceRecords, WhatIsLeftOutOrChangedIsReported) {
  const MaintenanceBench bench(GetParam(), all_maintenance);
  const std::string& good = bench.program.text;
  std::size_t number = 0;
  for (const Record& record : records(bench)) {
    SCOPED_TRACE(fmt::format("{} {}", number++, record.name));
    EXPECT_NE(bench.fault(good.substr(0, record.at) + good.substr(record.at + record.bytes)), "");
    EXPECT_NE(bench.fault(good.substr(0, record.at) + good.substr(record.at, record.bytes) + good.substr(record.at)) == "",
              record.name != "GOTO" && record.name != "ROLL")
        << "twice";
    for (std::size_t field = 8; field < record.bytes; field += 4) {
      std::string other = good;
      other[record.at + field + 1] = static_cast<char>(other[record.at + field + 1] ^ 64);
      EXPECT_NE(bench.fault(other), "") << "number " << field / 4 - 2;
    }
    std::string count = good;
    ++count[record.at + 4];
    EXPECT_NE(bench.fault(count), "");
  }
}

TEST_P(MaintenanceRecords, VatsAreFilledUnderTheCapAndTheBaseIsReported) {
  const MaintenanceBench bench(GetParam(), [](Machine& m) {
    all_maintenance(m);
    m.powder.vat_depth_mm = {20, 20};
    m.powder.refill = VatRefill::kPause;
    m.powder.base_layers = 3;
    m.powder.base_layer_mm = 0.2;
  });
  const Machine& m = bench.resolved.machine;
  const PixelGrid& grid = bench.resolved.grid.image;
  program::ProgramBytes bytes;
  const auto writer = program::find_dialect(m.dialect)->make_writer(m, bench.resolved.grid);
  LayerCycle cycle;
  cycle.layers = 9;
  cycle.thickness_nm = 100'000;
  cycle.refill = true;
  writer->begin_layer(cycle, bytes);
  writer->maintenance_of_layer(cycle, bytes);
  writer->maintenance_after(bytes);
  writer->end_layer(cycle, bytes);
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const auto all = records_of(text, planes(bench), bench.resolved.grid.nozzles);
  ASSERT_GE(all.size(), 4u);
  EXPECT_EQ(all[0].name + all[1].name + all[2].name + all[3].name, "GOTOFILLGOTOBASE");
  EXPECT_EQ(number_at(text, all[3].at + 8), 3u);
  EXPECT_EQ(number_at(text, all[3].at + 12), 200'000u);
  const auto machine = replay::VirtualMachine::build(m, grid.columns(), grid.rows());
  const Runs empty = program::testing::runs_of(program::testing::Image(grid.rows(), std::vector<int>(grid.columns(), 0)));
  const auto of = [&](const std::string& program) {
    return machine->replay(program, {0, 0, 100'000, LayerReason::kUniform}, empty, 0, 0);
  };
  const auto count = of(text);
  ASSERT_TRUE(count.ok()) << count.error().message;
  EXPECT_EQ(count->refills, 1u);
  for (const std::size_t i : {std::size_t{0}, std::size_t{3}}) {
    const auto wrong = of(text.substr(0, all[i].at) + text.substr(all[i].at + all[i].bytes));
    EXPECT_FALSE(wrong.ok()) << all[i].name;
  }
  // The host spreads four times: by the profile's ways and speeds, 3 x 0.2 mm and 0.1.
  const auto alone = machine->timed(text, {0, 0, 100'000, LayerReason::kUniform});
  const double strokes = 4 * 2 * std::abs(m.powder.roller_mm[1] - m.powder.roller_mm[0]) / m.powder.roller_speed_mm_s;
  const double spread =
      m.powder.spread_s > 0 ? 4 * m.powder.spread_s : strokes + (1 + m.powder.dose) * 0.7 / m.powder.vat_speed_mm_s;
  EXPECT_GT(alone->seconds(), spread + 2.5);
  EXPECT_LT(alone->seconds(), spread + 2.5 + 20);
}

// The timer sees sweeps and records alone, and reports what a replay of the whole program finds.
TEST_P(MaintenanceRecords, AreTimedWithoutVectors) {
  for (const double limit : {0.0, 12.0}) {
    const MaintenanceBench bench(GetParam(), [&](Machine& m) {
      all_maintenance(m);
      m.bed.size_mm = {60, 60};
      m.motion.scan_speed_mm_s = 20;
      m.maintenance.spit_seconds = limit;
    });
    const Machine& machine = bench.resolved.machine;
    const HeadGrid& grid = bench.resolved.grid;
    const auto built = replay::VirtualMachine::build(machine, grid.image.columns(), grid.image.rows());
    replay::Timer timer(*built);
    const auto writer = program::find_dialect(machine.dialect)->make_writer(machine, grid);
    LayerCycle cycle;
    cycle.layer = printed_parts::kLayer.index;
    cycle.layers = 9;
    cycle.bottom_nm = printed_parts::kLayer.bottom;
    cycle.thickness_nm = printed_parts::kLayer.thickness;
    timer.begin(printed_parts::kLayer);
    program::ProgramBytes bytes;
    const auto report = [&] {
      timer.maintenance(bytes);
      bytes.clear();
    };
    writer->maintenance_of_layer(cycle, bytes);
    report();
    program::CompileScratch scratch;
    const auto across = [&](std::int64_t line) {
      const std::size_t axis = grid.scan_axis == ScanAxis::kX ? 1 : 0;
      return grid.line_position_nm(line) / 1e6 + machine.mounting.offset_mm[axis];
    };
    ASSERT_TRUE(program::compile(
                    grid, bench.image, scratch,
                    [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
                      writer->maintenance_before(sweep, vectors, bytes);
                      report();
                      const std::int64_t low = vectors.first_step, high = low + vectors.steps - 1;
                      timer.sweep(across(sweep.first_line), sweep.backward, sweep.backward ? high : low,
                                  sweep.backward ? low : high);
                      return {};
                    },
                    cycle.layer)
                    .ok());
    writer->maintenance_after(bytes);
    report();
    const auto timed = timer.end();
    ASSERT_TRUE(timed.ok()) << timed.error().message;
    const auto replayed = bench.count(bench.program.text);
    ASSERT_TRUE(replayed.ok()) << replayed.error().message;
    EXPECT_EQ(timed->microseconds, replayed->microseconds);
    EXPECT_EQ(timed->spat, replayed->spat);
    EXPECT_GT(replayed->spits, limit > 0 ? 1u : 0u);
  }
}

// Vats of 2 mm, of which the host feeds 1.2 x 0.5 mm of each layer by the vats that the program names: three layers, half of it
// each where both feed.
TEST_P(MaintenanceRecords, VatsAreEmptiedByTheHost) {
  Machine machine;
  machine.powder.dose = 1.2;
  machine.powder.vats = 2;
  machine.powder.vat_depth_mm = {2, 2};
  replay::VatLevels levels(machine);
  replay::Count count;
  const auto take = [&](std::uint32_t layer, std::uint32_t vats) {
    count.vats = vats;
    return levels.take(layer, replay::with_fed_by_host(
                                  machine, {layer, static_cast<Nm>(layer * 500'000), 500'000, LayerReason::kUniform}, count));
  };
  for (std::uint32_t layer = 0; layer < 3; ++layer) EXPECT_TRUE(take(layer, 1).ok());
  EXPECT_TRUE(take(3, 2).ok());
  EXPECT_EQ(take(4, 3).error().message, "layer 4: takes 0.3 mm of the first vat, where 0.2 of 2 are left");
}

INSTANTIATE_TEST_SUITE_P(Dialects, MaintenanceRecords, testing::Values("xaar128-raw", "jet1000"));

// For any limit, no sweep ends later, by the clock of the replay; and as few shots as that takes.
TEST(Maintenance, ClocksAreKeptWhereSweepsAreNoEvenMovement) {
  const struct {
    const char* machine;
    std::vector<double> limits;
  } rows[] = {
      {"xaar128-raw", {12, 20, 45}}, {"jet1000", {12, 20, 45}}, {"reprap-inkjet", {11, 18, 60}}, {"brundlefab", {18, 30, 90}}};
  for (const auto& [name, limits] : rows) {
    std::uint32_t before = UINT32_MAX, maximum = 0;
    for (const double limit : limits) {
      SCOPED_TRACE(fmt::format("{} {}", name, limit));
      const MaintenanceBench bench(name, [&](Machine& m) {
        const bool bar = m.dialect == "brundlefab", stops = m.dialect == "m578";
        m.bed.size_mm = {stops ? 40.0 : 60.0, stops ? 40.0 : bar ? 150.0 : 60.0};
        if (!bar && !stops) m.motion.scan_speed_mm_s = 20;
        m.maintenance = {};
        m.maintenance.spit_drops = 40;
        m.maintenance.spit_seconds = limit;
        m.maintenance.spit_mm = bar ? std::array{400.0, 0.0} : std::array{-45.0, -10.0};
        if (bar) return;
        m.maintenance.wipe_seconds = 2 * limit;
        m.maintenance.wipe_mm = {{-45, -30, -45, -12}};
      });
      const auto count = bench.count(bench.program.text);
      ASSERT_TRUE(count.ok()) << count.error().message;
      EXPECT_LE(count->spits, before);
      EXPECT_GE(count->spits, 1u);
      // Each interval but the last is more than half of the limit: a sweep here takes less.
      EXPECT_LE(count->spits, 1 + static_cast<std::uint32_t>(count->seconds() / (0.4 * limit)));
      before = count->spits;
      maximum = std::max(maximum, count->spits);
    }
    EXPECT_GE(maximum, 2u) << name;
  }
}

/// Ticks of sprays, by carriage and nozzle, that must not fall on the bed.
std::map<long, std::map<int, int>> sprays_of(const std::string& text) {
  brundlefab_port::Printhead head(9, 12345);
  brundlefab_port::Board(head).run(text);
  std::map<long, std::map<int, int>> ticks;
  for (const auto& spray : head.sprays_made) {
    EXPECT_TRUE(spray.pattern == 0 || !spray.carriage_moves);
    for (int nozzle = 0; nozzle < 12; ++nozzle) {
      if ((spray.pattern >> nozzle & 1) != 0) ++ticks[std::lround(spray.carriage_mm * 1000)][nozzle];
    }
  }
  return ticks;
}

// By the port: with the pen at 400 mm all nozzles but the blocked one spray alike, the drops of the profile, there and back;
// and not one spray more than without the shot falls elsewhere.
TEST(Maintenance, ShotsOfTheBrundleFabAreFiredByItsFirmware) {
  const auto change = [](std::uint32_t drops) {
    return [drops](Machine& m) {
      m.maintenance = {};
      m.head.blocked = {5};
      m.bed.size_mm = {12, 60};
      if (drops == 0) return;
      m.maintenance.spit_layers = 7;
      m.maintenance.spit_drops = drops;
      m.maintenance.spit_mm = {{400, 0}};
    };
  };
  const MaintenanceBench none("brundlefab", change(0));
  auto before = sprays_of(none.program.text);
  for (const std::uint32_t drops : {1u, 40u, 834u, 2000u}) {
    SCOPED_TRACE(drops);
    const MaintenanceBench bench("brundlefab", change(drops));
    const auto count = bench.count(bench.program.text);
    ASSERT_TRUE(count.ok()) << count.error().message;
    EXPECT_EQ(count->spits, 1u);
    EXPECT_EQ(count->spat, drops * 11u);
    auto after = sprays_of(bench.program.text);
    auto shot = after[205'000];
    ASSERT_EQ(shot.size(), 11u);
    EXPECT_FALSE(shot.contains(5));
    for (const auto& [nozzle, ticks] : shot) {
      EXPECT_EQ(ticks, shot[0]);
      EXPECT_GE(ticks, static_cast<int>(drops) * 12) << "on six ticks of a dot at least, both ways";
      EXPECT_LE(ticks, static_cast<int>(drops) * 14);
    }
    after.erase(205'000);
    EXPECT_EQ(after.size(), before.size());
    // A dot less is no shot; a shot on the bed is none either.
    const std::string all = "T1 P4063\n";
    const std::size_t end = bench.program.text.find("T1 P0\n", bench.program.text.find(all));
    const std::size_t last = bench.program.text.rfind("G1 Y", end);
    const std::string less = bench.program.text.substr(0, last) + bench.program.text.substr(end);
    EXPECT_NE(bench.fault(less), "");
    std::string on = bench.program.text;
    on.replace(on.find("G1 X400.0000"), 12, "G1 X205.0000");
    EXPECT_NE(bench.fault(on), "");
  }
}

// Bins of the BrundleFab: three layers of 0.2 mm below the first one of 0.1.
TEST(Maintenance, TheBrundleFabSpreadsABaseBinByBin) {
  const MaintenanceBench bench("brundlefab", [](Machine& m) {
    m.maintenance = {};
    m.bed.build_height_mm = 100;
    m.powder.base_layers = 3;
    m.powder.base_layer_mm = 0.2;
  });
  const Machine& m = bench.resolved.machine;
  const PixelGrid& grid = bench.resolved.grid.image;
  const auto writer = program::find_dialect("brundlefab")->make_writer(m, bench.resolved.grid);
  const auto built = replay::VirtualMachine::build(m, grid.columns(), grid.rows());
  const Runs empty = program::testing::runs_of(program::testing::Image(grid.rows(), std::vector<int>(grid.columns(), 0)));
  for (const std::uint32_t layer : {0u, 1u}) {
    program::ProgramBytes bytes;
    LayerCycle cycle;
    cycle.layer = layer;
    cycle.layers = 9;
    cycle.bottom_nm = layer * 100'000;
    cycle.thickness_nm = 100'000;
    writer->begin_layer(cycle, bytes);
    writer->end_layer(cycle, bytes);
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const Layer at{layer, static_cast<Nm>(cycle.bottom_nm), 100'000, LayerReason::kUniform};
    const auto count = built->replay(text, at, empty, 0, 0);
    ASSERT_TRUE(count.ok()) << count.error().message << text;
    EXPECT_NEAR(count->fed_mm[0], m.powder.dose * (layer == 0 ? 0.7 : 0.1), 1e-6);
    if (layer > 0) continue;
    std::string wrong = text;
    const std::string feed = fmt::format("G1 E{:.4f} Z0.2000", m.powder.dose * 0.2);
    ASSERT_NE(wrong.find(feed), std::string::npos) << text;
    wrong.replace(wrong.find(feed), feed.size(), fmt::format("G1 E{:.4f} Z0.2500", m.powder.dose * 0.2));
    const auto fault = built->replay(wrong, at, empty, 0, 0);
    ASSERT_FALSE(fault.ok());
    EXPECT_NE(fault.error().message.find("layer 1 of the base is spread"), std::string::npos) << fault.error().message;
  }
}

}  // namespace
}  // namespace lamina
