// Layers of parts for the HP45 controller against its firmware: the decoder of stages/replay/hp45 and the port beside this
// file.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "stages/load/load.h"
#include "stages/raster/raster.h"
#include "tests/replay/hp45_bench.h"

namespace lamina::hp45_bench {
namespace {

/// What the port fires, beside the pixels that are wanted: those that no drop falls on, drops beside them, and on the way
/// between sweeps.
struct Difference {
  std::uint64_t missing = 0, added = 0, fired = 0;
};

Difference port_difference(const ResolvedMachine& resolved, const RunsView& image, const std::string& text) {
  const PixelGrid& grid = resolved.grid.image;
  const auto machine = *replay::VirtualMachine::build(resolved.machine, grid.columns(), grid.rows());
  firmware::Hp45Port port = port_of(resolved);
  port.run(text);
  EXPECT_EQ(port.unknown, 0u);
  std::vector<bool> once(std::size_t{grid.columns()} * grid.rows());
  Difference difference;
  for (const auto& detected : port.shown) {
    for (std::uint32_t n = 0; n < 300; ++n) {
      if (!detected.nozzles[n]) continue;
      const Pixel pixel = pixel_of(resolved, machine, detected, 299 - n);
      ++difference.fired;
      const bool wanted = printed_parts::is_set(image, pixel.first, pixel.second);
      const std::size_t position = wanted ? static_cast<std::size_t>(pixel.second * grid.columns() + pixel.first) : 0;
      difference.added += !wanted || once[position];
      if (wanted) once[position] = true;
    }
  }
  difference.missing = set_pixels(image) - (difference.fired - difference.added);
  return difference;
}

/// A part so large that its longer side has so many mm, and a bed of its size, with so many mm around it.
struct Bench {
  ResolvedMachine resolved;
  Part part;
  std::optional<raster::Rasterizer> rasterizer;
};

Bench bench_of(const std::string& file, Machine machine, double side_mm, double margin_mm) {
  const std::string path = std::string(LAMINA_TEST_DIR) + "/corpus/" + file;
  load::LoadOptions options;
  options.repair = false;
  const auto raw = load::load(path, options);
  EXPECT_TRUE(raw.ok()) << file;
  const double factor = side_mm * 1e6 / static_cast<double>(std::max(raw->bounds.width(), raw->bounds.depth()));
  options.transform = load::make_transform({factor, factor, factor}, {0, 0, 0}, {1, 1, 1});
  Part part = *load::load(path, options);
  const auto mm_of = [](std::int64_t nm) { return static_cast<double>(nm) / 1e6; };
  machine.bed.size_mm = {mm_of(part.bounds.width()) + 2 * margin_mm, mm_of(part.bounds.depth()) + 2 * margin_mm};
  const auto margin = static_cast<Nm>(margin_mm * 1e6);
  for (Instance& instance : part.instances) {
    instance.offset.x += margin - part.bounds.lo.x;
    instance.offset.y += margin - part.bounds.lo.y;
    instance.offset.z -= part.bounds.lo.z;
  }
  const auto resolved = resolve_profile(machine);
  EXPECT_TRUE(resolved.ok()) << (resolved.ok() ? "" : resolved.error().message);
  return {*resolved, std::move(part), {}};
}

Runs layer_of(Bench& bench, double share) {
  if (!bench.rasterizer) {
    auto built = raster::Rasterizer::build(bench.part.meshes, bench.part.instances, bench.resolved.grid.image,
                                           FillRule::kNonzero, false, true);
    EXPECT_TRUE(built.ok());
    bench.rasterizer.emplace(std::move(*built));
  }
  raster::LayerScratch scratch;
  Runs runs;
  bench.rasterizer->layer(raster::Engine::kContours, static_cast<Nm>(static_cast<double>(bench.part.bounds.height()) * share),
                          scratch, runs);
  return runs;
}

TEST(Hp45, TwelveLayersOfFivePartsAreFiredExactlyByTheDecoderAndByThePort) {
  Machine plain = shipped_by_name("hp45"), both = plain, blocked = plain, oasis = shipped_by_name("oasis"), turned = plain;
  both.motion.both_directions = true;
  both.mounting.scan_from = Side::kRight;
  blocked.head.blocked.insert(blocked.head.blocked.end(), {17, 150, 299});
  blocked.head.blocked_rule = BlockedRule::kSecondPass;
  turned.mounting.scan_axis = ScanAxis::kY;
  turned.mounting.scan_from = Side::kBack;
  turned.mounting.nozzle_0 = Side::kRight;
  turned.mounting.offset_mm = {13.2, 31.7};
  // One swath is 12.7 mm wide. A bed without a margin has the part in its first and last columns.
  const struct {
    const char* file;
    const Machine& machine;
    double side_mm, margin_mm;
  } cases[] = {{"parameter_quality_nut.stl", plain, 16, 0},
               {"dental_crown.stl", both, 15, 2},
               {"nist_am_test_artifact_v3b.stl", oasis, 26, 0},
               {"quad_knot.obj", blocked, 14, 0},
               {"rabbit_9_overlapping_shells.obj", turned, 12, 1}};
  std::uint64_t drops = 0, layers = 0;
  for (const auto& one : cases) {
    Bench bench = bench_of(one.file, one.machine, one.side_mm, one.margin_mm);
    for (int layer = 0; layer < 12; ++layer) {
      const Runs image = layer_of(bench, (layer + 0.37) / 12);
      const LayerProgram program = program_of(bench.resolved, image);
      ASSERT_EQ(program.count.lost + program.count.moved, 0u);
      const auto decoded = verdict(bench.resolved, image, program.text, program.count);
      ASSERT_TRUE(decoded.ok()) << one.file << " " << layer << ": " << decoded.error().message;
      EXPECT_EQ(decoded->drops, set_pixels(image)) << one.file << " " << layer;
      const Difference port = port_difference(bench.resolved, image, program.text);
      EXPECT_EQ(port.missing, 0u) << one.file << " " << layer;
      EXPECT_EQ(port.added, 0u) << one.file << " " << layer;
      EXPECT_EQ(port.fired, decoded->drops) << one.file << " " << layer;
      drops += decoded->drops;
      ++layers;
    }
  }
  EXPECT_EQ(layers, 60u);
  EXPECT_GT(drops, 500'000u);
}

// The firmware's bursts come by the clock: the numbers of drops are those of the image to a percent or so, and none falls more
// than a pixel beside it.
TEST(Hp45, BurstsOfTheClockFallWithinAPixelOfTheImage) {
  Machine machine = shipped_by_name("hp45");
  machine.bed.size_mm = {20, 12};
  const ResolvedMachine resolved = *resolve_profile(machine);
  const PixelGrid& grid = resolved.grid.image;
  const Runs image = slotted_disc(grid);
  const auto virtual_machine = *replay::VirtualMachine::build(resolved.machine, grid.columns(), grid.rows());
  firmware::Hp45Port port = port_of(resolved);
  port.clocked = true;
  port.tick_us = 2;
  port.run(program_of(resolved, image).text);
  std::uint64_t drops = 0, neighbour = 0;
  for (const auto& detected : port.fired) {
    for (std::uint32_t n = 0; n < 300; ++n) {
      if (!detected.nozzles[n]) continue;
      const Pixel at = pixel_of(resolved, virtual_machine, detected, 299 - n);
      ++drops;
      const auto set = [&](int aside) { return printed_parts::is_set(image, at.first + aside, at.second); };
      neighbour += !set(0) && !set(-1) && !set(1);
    }
  }
  EXPECT_EQ(neighbour, 0u);
  EXPECT_NEAR(static_cast<double>(drops) / static_cast<double>(set_pixels(image)), 1, 0.03);
}

TEST(Hp45, HeadsOfHalfTheResolutionFireTwoNozzlesAsOne) {
  const SlottedDisc disc({15, 20}, [](Machine& machine) {
    machine.head.nozzles = 150;
    machine.head.blocked = {0, 64, 131};  // the pairs of 0, 129 and 263, whose drops fall on other lines
    machine.head.pitch_um = 25'400.0 / 300;
    machine.mounting.dpi = 300;
  });
  EXPECT_NE(disc.program.text.find("SDP Es\nSDN y\n"), std::string::npos);
  const auto printed = disc.verdict_of(disc.lines);
  ASSERT_TRUE(printed.ok()) << printed.error().message;
  EXPECT_EQ(printed->drops, set_pixels(disc.image));
}

// The map() of Teensy's core is wrong below 0, and that of a fine encoder beyond 32 bits: there sweeps start at 0.
TEST(Hp45, SweepsThatStartWhereTheControllerCannotCountStartAtZero) {
  Machine below = shipped_by_name("hp45"), beyond = below;
  below.bed.size_mm = beyond.bed.size_mm = {20, 10};
  below.mounting.offset_mm = {0, 0};
  beyond.motion.encoder_dpi = 24'000;
  beyond.mounting.offset_mm = {200, 20};
  for (const Machine& machine : {below, beyond}) {
    const ResolvedMachine resolved = *resolve_profile(machine);
    const Runs image = slotted_disc(resolved.grid.image);
    const LayerProgram program = program_of(resolved, image);
    EXPECT_NE(program.text.find("\nSEP A\n"), std::string::npos);
    const auto printed = verdict(resolved, image, program.text, program.count);
    ASSERT_TRUE(printed.ok()) << printed.error().message;
    EXPECT_EQ(printed->drops, set_pixels(image));
    if (machine.motion.encoder_dpi > 600) continue;
    const Difference port = port_difference(resolved, image, program.text);
    EXPECT_EQ(port.missing + port.added, 0u);
  }
}

TEST(Oasis, SpreadersThatStartNextToTheGantryAreRefused) {
  Machine machine = shipped_by_name("oasis");
  machine.powder.roller_axis = "Y";
  const auto refused = resolve_profile(machine);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("starts at 100 mm, and the gantry waits at 240"), std::string::npos)
      << refused.error().message;
  machine.powder.roller_axis = "U";
  EXPECT_TRUE(resolve_profile(machine).ok());
}

// SerialGRBL.py, NewLayer(0.1): overfill 1.1, clearance 0.25, hysteresis 1.
TEST(Oasis, NewLayerMovesAsItsHostDoes) {
  Machine machine = shipped_by_name("oasis");
  machine.bed.size_mm = {10, 10};
  const ResolvedMachine resolved = *resolve_profile(machine);
  const std::string text = program_of(resolved, slotted_disc(resolved.grid.image)).text;
  EXPECT_NE(text.find("BMOD A\nG1 Z1.7000 F150\nG1 Z0.5500 F150\nG91\nG1 A1.0000 F150\nG1 A-1.3600 F150\n"
                      "G90\nM4\nG1 X475.0000 F6000\nM5\nG1 Z1.5500 F150\nG1 Z0.8000 F150\nG91\nG1 A1.0000 F150\n"
                      "G1 A-0.7500 F150\nG90\nG4 P0\n"),
            std::string::npos)
      << text.substr(0, 600);
}

}  // namespace
}  // namespace lamina::hp45_bench
