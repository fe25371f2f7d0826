// tests/pipeline/pores/test_predicted_flow.cpp: beads of a written file become voxels, and these a permeability.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "pipeline/pores/bead_voxels.h"
#include "pipeline/pores/predict_flow.h"
#include "pipeline/pores/window_choice.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

constexpr double kWidth = 0.5, kHeight = 0.3, kSpacing = 0.8;  // mm

/// Five layers of lines along y; `crossed`: every other layer along x.
void write_lines(const std::string& path, bool crossed) {
  std::ofstream file(path);
  file << "G21\nG90\nM83\n";
  for (int layer = 1; layer <= 5; ++layer) {
    const double z = kHeight * layer;
    file << ";LAYER_CHANGE\n;Z:" << z << "\n;HEIGHT:" << kHeight << "\nG1 Z" << z << " F600\n;WIDTH:" << kWidth << "\n";
    for (int line = 0; line < 20; ++line) {
      const double at = 10 + kSpacing * line;
      if (crossed && layer % 2 == 0)
        file << "G0 X10 Y" << at << "\nG1 X25.2 Y" << at << " E1 F900\n";
      else
        file << "G0 X" << at << " Y10\nG1 X" << at << " Y25.2 E1 F900\n";
    }
  }
}

struct DepositedParts {
  formats::GcodeFile file;
  pipeline::Pile pile;
};
DepositedParts deposited(const std::string& path) {
  Result<formats::GcodeFile> file = formats::GcodeFile::open(path);
  EXPECT_TRUE(file.ok());
  Result<pipeline::Pile> pile = pipeline::pile_of(*file);
  EXPECT_TRUE(pile.ok());
  return {std::move(*file), std::move(*pile)};
}

/// Of so many voxels, each `finer` times finer along its edges.
pipeline::Window period_around(const DepositedParts& lines, std::uint32_t layers, std::array<std::uint32_t, 3> count,
                               std::uint32_t finer = 1) {
  pipeline::Window window;
  window.box.add(Point3{17'600'000, 17'600'000, static_cast<Nm>(lines.pile.layers[1].low)});
  window.box.add(Point3{18'400'000, 18'400'000, static_cast<Nm>(lines.pile.layers[layers].high)});
  window.count = count;
  window.periodic = {true, true, true};
  return pipeline::finer(window, finer);
}

/// Of so many layers, in these voxels and in twice as large ones.
pipeline::PoreReport report_of(const DepositedParts& lines, std::uint32_t layers, std::array<std::uint32_t, 3> count,
                               std::array<std::uint32_t, 3> coarse_count) {
  const auto cut = [&](std::array<std::uint32_t, 3> into, std::uint32_t finer) {
    Result<VoxelStack> voxels = pipeline::bead_voxels(lines.file, lines.pile, period_around(lines, layers, into, finer));
    EXPECT_TRUE(voxels.ok());
    return std::move(*voxels);
  };
  const VoxelStack voxels = cut(count, 1), fine = cut(count, pipeline::kFiner), coarse = cut(coarse_count, pipeline::kFiner);
  const Result<pipeline::PoreReport> report = pipeline::analyse_pores({voxels, fine, coarse}, {}, [](double) { return true; });
  EXPECT_TRUE(report.ok());
  return *report;
}

TEST(PredictedFlow, WhatRepeatsIsFoundInTheFile) {
  test::Directory folder;
  write_lines(folder / "straight.gcode", false);
  write_lines(folder / "crossed.gcode", true);
  const DepositedParts straight = deposited(folder / "straight.gcode"), crossed = deposited(folder / "crossed.gcode");
  ASSERT_EQ(straight.pile.layers.size(), 5u);
  EXPECT_EQ(straight.pile.layers[2].low, 600'000);
  const Result<pipeline::Repeat> one = pipeline::find_repeat(straight.file, straight.pile, {17'600'000, 17'600'000}, 1);
  const Result<pipeline::Repeat> two = pipeline::find_repeat(crossed.file, crossed.pile, {17'600'000, 17'600'000}, 1);
  ASSERT_TRUE(one.ok() && two.ok());
  EXPECT_EQ(one->length[0], 800'000);
  EXPECT_LE(one->length[1], 200'000) << "any length along the lines";
  EXPECT_EQ(one->layers, 1u);
  EXPECT_EQ(two->length, (std::array<std::int64_t, 2>{800'000, 800'000}));
  EXPECT_EQ(two->layers, 2u);
}

/// By hand: what stadia of 0.5 x 0.3 mm leave of cells of 0.8 x 0.3 mm.
TEST(PredictedFlow, StraightLinesLeaveWhatTheirStadiaDoAndNothingFlowsAcrossThem) {
  test::Directory folder;
  write_lines(folder / "lines.gcode", false);
  const DepositedParts lines = deposited(folder / "lines.gcode");
  const pipeline::PoreReport report = report_of(lines, 1, {80, 8, 60}, {40, 4, 30});
  const double bead = kHeight * (kWidth - kHeight) + std::numbers::pi / 4 * kHeight * kHeight;
  EXPECT_NEAR(report.porosity.total(), 1 - bead / (kSpacing * kHeight), 0.005);
  EXPECT_EQ(report.flow[0]->k_m2[0], 0) << "beads of all layers stand upon each other";
  EXPECT_GT(report.flow[1]->k_m2[1], 0);
  EXPECT_NEAR(report.flow[1]->tortuosity, 1, 1e-3) << "straight along the lines";
  EXPECT_GT(report.flow[2]->tortuosity, 1);
  EXPECT_GT(report.flow[2]->error_m2[2], 0);
}

/// Lines that cross make both directions of the bed alike.
TEST(PredictedFlow, CrossedLinesLeadAlikeAlongXAndY) {
  test::Directory folder;
  write_lines(folder / "lines.gcode", true);
  const DepositedParts lines = deposited(folder / "lines.gcode");
  const pipeline::PoreReport report = report_of(lines, 2, {32, 32, 24}, {16, 16, 12});
  EXPECT_EQ(report.flow[0]->k_m2[0], report.flow[1]->k_m2[1]) << "turned and upside down it is the same window";
  EXPECT_DOUBLE_EQ(report.porosity.total(), report.porosity.percolating(2));
}

/// 1 mm of filament of 1.75 mm on 15.2 mm, in the middle of lines that the melt's lag does not reach.
TEST(PredictedFlow, WhatIsFedIsDeposited) {
  test::Directory folder;
  write_lines(folder / "lines.gcode", false);
  const DepositedParts lines = deposited(folder / "lines.gcode");
  bead::DepositionRules rules;
  rules.machine.tau_s = 0.046;
  rules.machine.acceleration_mm_s2 = 400;
  const double area = std::numbers::pi / 4 * 1.75 * 1.75 / 15.2;
  for (const double spacing : {kSpacing, 2 * kSpacing}) {
    pipeline::Window window = period_around(lines, 1, {160, 16, 120});
    window.box.hi.x = window.box.lo.x + static_cast<Nm>(spacing * 1e6);
    const Result<VoxelStack> voxels = pipeline::bead_voxels(lines.file, lines.pile, window, &rules);
    ASSERT_TRUE(voxels.ok());
    const double solid = static_cast<double>(set_voxels(*voxels)) / static_cast<double>(window.voxels());
    EXPECT_NEAR(solid, area / (kSpacing * kHeight), 0.003);
  }
}

TEST(PredictedFlow, AWindowThatDoesNotFitTheMemoryIsRefusedWithVoxelsThatDo) {
  test::Directory folder;
  write_lines(folder / "lines.gcode", false);
  const DepositedParts lines = deposited(folder / "lines.gcode");
  const Result<VoxelStack> box = pipeline::bead_voxels(lines.file, lines.pile, period_around(lines, 1, {80, 80, 30}));
  ASSERT_TRUE(box.ok());
  pipeline::FlowRequest request;
  request.memory_bytes = 1'000'000;
  const Result<pipeline::PoreReport> report = pipeline::analyse_pores({*box, *box, *box}, request, [](double) { return true; });
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.error().fault, Fault::kUsage);
  EXPECT_NE(report.error().message.find("take --voxel"), std::string::npos) << report.error().message;
}

/// Voxels that see a pore in one way, and twice as large ones in another, tell so and never a negative permeability.
TEST(PredictedFlow, VoxelsThatAreTooCoarseSaySo) {
  test::Directory folder;
  write_lines(folder / "lines.gcode", true);
  const DepositedParts lines = deposited(folder / "lines.gcode");
  const pipeline::PoreReport report = report_of(lines, 2, {5, 5, 4}, {1, 1, 1});
  for (std::size_t a = 0; a < 3; ++a) {
    const pipeline::Darcy& darcy = *report.flow[a];
    EXPECT_GE(darcy.k_m2[a], 0);
    if (darcy.steps > 0 && !darcy.resolved) {
      EXPECT_DOUBLE_EQ(darcy.error_m2[a], darcy.k_m2[a]);
    }
  }
  EXPECT_FALSE(report.flow[2]->steps > 0 && report.flow[2]->resolved);
}

/// Two thousand times upon itself a line finds no room; told widths do not care.
TEST(PredictedFlow, BeadsUponEachOtherAreRefusedByRulesAndNotAsStated) {
  test::Directory folder;
  std::ofstream file(folder / "heap.gcode");
  file << "G21\nG90\nM83\n;LAYER_CHANGE\n;Z:0.3\n;HEIGHT:0.3\nG1 Z0.3 F600\n;WIDTH:0.5\n";
  for (int line = 0; line < 2000; ++line) file << "G0 X10 Y10\nG1 X25 Y10 E1 F900\n";
  file.close();
  const DepositedParts heap = deposited(folder / "heap.gcode");
  pipeline::Window window;
  window.box.add(Point3{17'000'000, 9'500'000, 0});
  window.box.add(Point3{18'000'000, 10'500'000, 300'000});
  window.count = {20, 20, 6};
  bead::DepositionRules rules;
  rules.machine.tau_s = 0.046;
  EXPECT_TRUE(pipeline::bead_voxels(heap.file, heap.pile, window).ok());
  const Result<VoxelStack> refused = pipeline::bead_voxels(heap.file, heap.pile, window, &rules);
  ASSERT_FALSE(refused.ok());
  EXPECT_FALSE(refused.error().message.empty());
}

TEST(PredictedFlow, AWindowLargerThanThePrintIsRefused) {
  test::Directory folder;
  write_lines(folder / "lines.gcode", false);
  const DepositedParts lines = deposited(folder / "lines.gcode");
  for (const std::array<double, 3> size : {std::array{50.0, 1.0, 0.3}, {1.0, 50.0, 0.3}, {1.0, 1.0, 2.0}}) {
    const Result<pipeline::WindowChoice> choice = pipeline::choose_window(lines.file, lines.pile, {10, size});
    ASSERT_FALSE(choice.ok());
    EXPECT_EQ(choice.error().fault, Fault::kUsage);
  }
}

TEST(PredictedFlow, LayersThatDoNotLieAboveTheOthersAreCounted) {
  test::Directory folder;
  std::ofstream(folder / "low.gcode") << "G90\nM82\nG1 Z0 F300\nG1 X0 Y0\nG1 X10 Y0 E1\nG1 X10 Y10 E2\n";
  const DepositedParts lines = deposited(folder / "low.gcode");
  EXPECT_TRUE(lines.pile.layers.empty());
  EXPECT_EQ(lines.pile.skipped, 1u);
}

}  // namespace
}  // namespace lamina
