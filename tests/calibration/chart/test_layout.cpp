// tests/calibration/chart/test_layout.cpp: every dash of a chart is of the nozzle that it names, and drops are as many as
// stated.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/calibrate/chart_job.h"
#include "pipeline/machine/profiles.h"
#include "stages/calibration/chart/layout.h"
#include "stages/data/runs.h"
#include "stages/formats/chart/chart.h"
#include "stages/program/compile.h"

namespace lamina::test {
namespace {

/// The machine as calibrate has it: its own blocked nozzles where its controller insists on them.
pipeline::ResolvedMachine machine_of_chart(const std::string& name) {
  const auto machine = pipeline::find_machine(name);
  EXPECT_TRUE(machine) << name;
  auto resolved = pipeline::resolve_profile(calibration::chart_machine(*machine));
  if (!resolved) resolved = pipeline::resolve_profile(calibration::chart_machine(*machine, true));
  EXPECT_TRUE(resolved) << resolved.error().message;
  return *resolved;
}

/// Drops of each swath and nozzle.
std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint64_t> fired(const HeadGrid& grid, const RunsView& image) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint64_t> drops;
  program::CompileScratch scratch;
  const auto count = program::compile(grid, image, scratch, [&](const Sweep& sweep, const SweepVectors& vectors) {
    for (std::uint32_t step = 0; step < vectors.steps; ++step) {
      const std::uint64_t* words = vectors.step(vectors.first_step + step);
      for (std::uint32_t n = 0; n < grid.nozzles; ++n) {
        const std::uint32_t bit = n ^ grid.bit_order;
        if (words[bit / 64] >> bit % 64 & 1) ++drops[{sweep.swath, n}];
      }
    }
    return Status();
  });
  EXPECT_TRUE(count);
  return drops;
}

TEST(ChartLayout, DashesAreFiredByTheNozzlesThatTheyName) {
  for (const std::string_view name : pipeline::names_of(pipeline::shipped_machines())) {
    const auto machine = machine_of_chart(std::string(name));
    const auto deposited = calibration::layout_chart(machine.machine, machine.grid);
    ASSERT_TRUE(deposited) << name << ": " << deposited.error().message;
    Chart dashes = *deposited;
    dashes.marks.clear();
    dashes.bars.clear();
    dashes.wedges.clear();
    dashes.stitches.clear();
    dashes.verniers.clear();
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint64_t> wanted;
    for (const ChartDash& dash : dashes.dashes)
      wanted[{dash.swath, dash.nozzle}] += (dash.box.right - dash.box.left) * (dash.box.bottom - dash.box.top);
    const auto drops = fired(machine.grid, calibration::draw(dashes));
    const std::uint32_t first = drops.begin()->first.first;  // of the bed's swaths
    ASSERT_EQ(drops.size(), wanted.size()) << name;
    for (const auto& [who, count] : wanted) {
      const auto found = drops.find({first + who.first, who.second});
      ASSERT_TRUE(found != drops.end() && found->second == count)
          << name << ": swath " << who.first << ", nozzle " << who.second;
    }
    const auto free_nozzles = machine.grid.nozzles - machine.grid.blocked.size();
    EXPECT_EQ(wanted.size(), free_nozzles * deposited->swaths) << name;
  }
}

TEST(ChartLayout, NothingTouchesAnythingElse) {
  for (const std::string_view name : pipeline::names_of(pipeline::shipped_machines())) {
    const auto machine = machine_of_chart(std::string(name));
    const auto deposited = calibration::layout_chart(machine.machine, machine.grid);
    ASSERT_TRUE(deposited);
    std::vector<ChartBox> boxes = deposited->marks;
    for (const ChartBar& bar : deposited->bars) boxes.push_back(bar.box);
    for (const ChartWedge& wedge : deposited->wedges) boxes.push_back(wedge.box);
    for (const ChartBox& joint : deposited->stitches) boxes.push_back(joint);
    for (const ChartVernier& vernier : deposited->verniers) {
      boxes.insert(boxes.end(), vernier.before.begin(), vernier.before.end());
      boxes.insert(boxes.end(), vernier.after.begin(), vernier.after.end());
    }
    for (const ChartDash& dash : deposited->dashes) boxes.push_back(dash.box);
    const std::size_t others = boxes.size() - deposited->dashes.size();
    for (std::size_t i = 0; i < others; ++i) {
      for (std::size_t j = i + 1; j < boxes.size(); ++j) {
        const ChartBox &a = boxes[i], &b = boxes[j];
        EXPECT_FALSE(a.left <= b.right && b.left <= a.right && a.top <= b.bottom && b.top <= a.bottom)
            << name << ' ' << i << ' ' << j;
      }
    }
  }
}

TEST(ChartLayout, JsonKeepsAllOfAChart) {
  const auto machine = machine_of_chart("nuferbj");
  const auto deposited = calibration::layout_chart(machine.machine, machine.grid);
  ASSERT_TRUE(deposited);
  const std::string text = chart_text(*deposited);
  const auto again = read_chart(text, "chart.json");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(*again, *deposited);
  // Every cut of it is refused in one line.
  for (std::size_t length = 0; length + 1 < text.size(); length += text.size() / 97) {
    const auto cut = read_chart(text.substr(0, length), "chart.json");
    ASSERT_FALSE(cut);
    EXPECT_EQ(std::ranges::count(cut.error().message, '\n'), 0);
    EXPECT_EQ(cut.error().fault, Fault::kInput);
  }
}

TEST(ChartLayout, ABedWithoutSpaceIsRefused) {
  auto machine = *pipeline::find_machine("hp45");
  machine.bed.size_mm = {30, 30};
  const auto resolved = pipeline::resolve_profile(machine);
  ASSERT_TRUE(resolved);
  const auto deposited = calibration::layout_chart(resolved->machine, resolved->grid);
  ASSERT_FALSE(deposited);
  EXPECT_EQ(deposited.error().fault, Fault::kUsage);
}

TEST(ChartDrops, AreAsManyAsStatedAndEvenAmongNozzles) {
  const auto machine = machine_of_chart("nuferbj");
  for (const std::uint64_t drops : {1ull, 127ull, 364'032ull, 364'033ull, 1'000'000ull}) {
    const auto wanted = calibration::layout_drops(machine.machine, machine.grid, drops);
    ASSERT_TRUE(wanted);
    std::uint64_t sum = 0;
    for (std::uint32_t layer = 0; layer < wanted->layers; ++layer)
      sum += set_pixels(calibration::draw_drops(*wanted, machine.grid, layer));
    EXPECT_EQ(sum, drops);
  }
  const auto whole = calibration::layout_drops(machine.machine, machine.grid, 364'032);
  ASSERT_TRUE(whole);
  ASSERT_EQ(whole->layers, 1u);
  std::map<std::uint32_t, std::uint64_t> by_nozzle;
  for (const auto& [who, count] : fired(machine.grid, calibration::draw_drops(*whole, machine.grid, 0)))
    by_nozzle[who.second] += count;
  ASSERT_EQ(by_nozzle.size(), 128u);
  for (const auto& [nozzle, count] : by_nozzle) EXPECT_EQ(count, 364'032u / 128);
  EXPECT_FALSE(calibration::layout_drops(machine.machine, machine.grid, 1'000'000'000'000));
}

/// 52.5 mg of water, a million drops: 52.5 nl / 1000, by hand.
TEST(ChartDrops, VolumeFollowsFromMass) {
  EXPECT_DOUBLE_EQ(calibration::drop_pl_of(52.5, 1, 1e6), 52.5);
  EXPECT_DOUBLE_EQ(calibration::drop_pl_of(52.5, 1.05, 1e6), 50);
  EXPECT_DOUBLE_EQ(calibration::drop_pl_of(0.5, 1, 1e7), 0.05);
}

/// Ticks of a swath are fired by it alone, and pair m + k lines up if the later swath lies k places too far.
TEST(ChartLayout, VerniersShowWholePixels) {
  std::size_t detected = 0;
  for (const std::string_view name : pipeline::names_of(pipeline::shipped_machines())) {
    const auto machine = machine_of_chart(std::string(name));
    const auto deposited = calibration::layout_chart(machine.machine, machine.grid);
    ASSERT_TRUE(deposited);
    // In addition to the dashes, which mark the starts of swaths.
    Chart dashes = *deposited;
    dashes.marks.clear(), dashes.bars.clear(), dashes.wedges.clear(), dashes.stitches.clear(), dashes.verniers.clear();
    const auto alone = fired(machine.grid, calibration::draw(dashes));
    const auto drops_of_swath = [&](const ChartVernier& ticks) {
      Chart more = dashes;
      more.verniers = {ticks};
      std::map<std::uint32_t, std::uint64_t> drops;
      for (const auto& [who, count] : fired(machine.grid, calibration::draw(more)))
        if (const auto before = alone.find(who); count > (before == alone.end() ? 0 : before->second))
          drops[who.first - alone.begin()->first.first] += count;
      return drops;
    };
    for (const ChartVernier& vernier : deposited->verniers) {
      ++detected;
      ASSERT_EQ(vernier.before.size(), 9u);
      const auto one = drops_of_swath({vernier.swath, vernier.before, {}}),
                 other = drops_of_swath({vernier.swath, {}, vernier.after});
      ASSERT_TRUE(one.size() == 1 && other.size() == 1) << name;
      EXPECT_EQ(one.begin()->first, vernier.swath - 1) << name;
      EXPECT_EQ(other.begin()->first, vernier.swath) << name;
      for (std::size_t i = 0; i < 9; ++i) {
        const std::int64_t a = deposited->scan_along_x ? vernier.before[i].left : vernier.before[i].top,
                           b = deposited->scan_along_x ? vernier.after[i].left : vernier.after[i].top;
        EXPECT_EQ(b + (static_cast<std::int64_t>(i) - 4) * deposited->along_sign, a) << name << ' ' << i;
      }
    }
  }
  EXPECT_GE(detected, 10u);
}

/// nuferbj, by hand: 50 pl = 50,000 um3 on 96.944 x 96.944 x 100 um, of which 40 % are voids: 13.30 %.
TEST(ChartMeasured, WedgesAreTakenForSaturations) {
  const auto machine = machine_of_chart("nuferbj");
  auto deposited = calibration::layout_chart(machine.machine, machine.grid);
  ASSERT_TRUE(deposited);
  EXPECT_EQ(pipeline::saturation_of(100, *deposited, machine.machine), 0);  // of no thickness
  deposited->layer_mm = 0.1;
  EXPECT_NEAR(pipeline::saturation_of(100, *deposited, machine.machine), 13.30, 0.01);
  EXPECT_NEAR(pipeline::saturation_of(25, *deposited, machine.machine), 3.325, 0.003);
}

/// A reading with two rows: odd nozzles land 10 um too far, so that their row is less far behind by as much. One is printed
/// too faintly to locate along the scan: its share of the row's mean, 0.5 um, follows from its error.
TEST(ChartMeasured, ReadingsBecomeKeysOfAProfile) {
  Machine machine;
  machine.head.nozzles = 6;
  machine.head.row_offset_um = {0, 2540};
  machine.head.blocked = {1};
  machine.mounting.scan_axis = ScanAxis::kY;
  Chart chart;
  chart.pixel_x_nm = chart.pixel_y_nm = 100'000;
  chart.layer_mm = 0.1;
  const char* reading =
      R"({"pixels_per_mm":20,"scatter_um":5,"blocked":[2],"weak":[],"unreadable":[],"swaths":[{"along_um":0,"across_um":0},{"along_um":30,"along_within_um":2.25,"across_um":null,"across_within_um":80},null],)"
      R"("nozzles":[{"along_um":-5,"along_error_um":0.5,"along_within_um":2,"across_um":0,"across_error_um":0.5,"across_within_um":2},)"
      R"({"along_um":5,"along_error_um":0.5,"along_within_um":2,"across_um":0,"across_error_um":0.5,"across_within_um":2},null,)"
      R"({"along_um":5,"along_error_um":0.5,"along_within_um":2,"across_um":1,"across_error_um":0.5,"across_within_um":2},)"
      R"({"along_um":-8,"along_error_um":3,"along_within_um":11,"across_um":1,"across_error_um":0.5,"across_within_um":2},null],)"
      R"("stitches":[{"swath":1,"along_um":30,"across_um":-41,"agrees":false}],)"
      R"("dot_gain_um":{"along":12.4,"across":30.6},"wedges":[{"pixels_percent":50,"detected_percent":61}]})";
  const auto lines = pipeline::take_over(reading, chart, machine);
  ASSERT_TRUE(lines) << lines.error().message;
  EXPECT_EQ(machine.head.blocked, (std::vector<std::uint32_t>{2}));
  EXPECT_EQ(machine.head.row_offset_um, (std::vector<double>{0, 2529.5}));
  EXPECT_EQ(machine.head.dot_gain_um, (std::array<double, 2>{31, 12}));
  for (const char* words :
       {"--bleed 31x12", "was not printed", "unreadable across, +30.0 um (within 2.2) along", "stitch 1  shows -41 um across",
        "4 read, within 8 um along the scan and 1 across", "median 99 % limits 2.0 and 2.0 um", "change of -10.5 um (within ",
        "50 % of the pixels, 6.2 % saturation: 61 %"})
    EXPECT_EQ(std::ranges::count_if(*lines, [&](const std::string& line) { return line.find(words) != std::string::npos; }), 1)
        << words;
  EXPECT_FALSE(pipeline::take_over("{}", chart, machine));
}

}  // namespace
}  // namespace lamina::test
