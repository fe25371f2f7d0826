// Programs of every shipped machine and of random ones, carried out by the virtual machine.
#include "stages/replay/machine.h"

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <regex>

#include "pipeline/machine/profiles.h"
#include "stages/load/load.h"
#include "stages/program/compile.h"
#include "stages/program/dialect.h"
#include "stages/raster/raster.h"
#include "tests/program/machines.h"
#include "tests/replay/printed_parts.h"

namespace lamina::pipeline {
namespace {

using program::testing::Image;
using program::testing::Random;
using program::testing::random_image;
using program::testing::runs_of;

using Written = printed_parts::Program;

/// The machine with a bed of so many of its own pixels.
ResolvedMachine shrunk(Machine machine, double columns, double rows) {
  const auto whole = resolve_profile(machine);
  EXPECT_TRUE(whole.ok()) << (whole.ok() ? "" : whole.error().message);
  const PixelGrid& grid = whole->grid.image;
  machine.bed.size_mm = {columns / grid.x.pixels_per_nm() / 1e6, rows / grid.y.pixels_per_nm() / 1e6};
  const auto small = resolve_profile(machine);
  EXPECT_TRUE(small.ok()) << (small.ok() ? "" : small.error().message);
  return *small;
}

TEST(Replay, PrintsTheImageBitForBitOnEveryShippedProfile) {
  Random random(11);
  for (const ShippedProfile& shipped : shipped_machines()) {
    const auto machine = read_machine(shipped.text, std::string(shipped.name));
    for (int image_number = 0; image_number < 6; ++image_number) {
      const ResolvedMachine resolved = shrunk(*machine, 130 + random() % 200, 130 + random() % 200);
      const Image image = random_image(random, resolved.grid.image.columns(), resolved.grid.image.rows());
      const Runs runs = runs_of(image);
      const Written program = printed_parts::program_of(resolved, runs);
      const auto printed = printed_parts::verified(resolved, runs, program);
      ASSERT_TRUE(printed.ok()) << shipped.name << ": " << printed.error().message;
      EXPECT_EQ(printed->drops, set_pixels(runs));
      EXPECT_EQ(printed->vectors, program.count.vectors) << shipped.name;
      // A BrundleFab's dots are 10 / 5250 longer than the image's, counted from the bar's home.
      const double home_um = machine->dialect == "brundlefab" ? (runs.view().rows() + 2) * resolved.grid.step_nm() / 1000 : 0;
      EXPECT_LE(printed->farthest_along_um, resolved.grid.step_nm() / 2000 + 1e-6 + home_um * 10 / 5250);
    }
  }
}

/// A closed part of the requested size across its larger side, standing in the middle of a bed; nothing if it is not closed.
struct AxisPositions {
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  Box bounds;
};

AxisPositions scaled(const Part& part, double side_mm, const Machine& machine) {
  const double factor =
      side_mm * 1e6 / static_cast<double>(std::max({part.bounds.width(), part.bounds.depth(), std::int64_t{1}}));
  const auto point = [&](const Point3& p) {
    const auto nm = [&](Nm v) { return static_cast<Nm>(std::llround(v * factor)); };
    return Point3{nm(p.x), nm(p.y), nm(p.z)};
  };
  AxisPositions made;
  for (const Mesh& mesh : part.meshes) {
    Mesh& own = made.meshes.emplace_back(mesh);
    own.bounds = {};
    for (Triangle& t : own.triangles) {
      t = {point(t.a), point(t.b), point(t.c)};
      for (const Point3& p : {t.a, t.b, t.c}) own.bounds.add(p);
    }
  }
  const auto moved = [](const Point3& p, const Point3& by) { return Point3{p.x + by.x, p.y + by.y, p.z + by.z}; };
  for (const Instance& instance : part.instances) {
    made.instances.push_back({instance.mesh, point(instance.offset)});
    const Box& box = made.meshes[instance.mesh].bounds;
    made.bounds.add(Box{moved(box.lo, made.instances.back().offset), moved(box.hi, made.instances.back().offset)});
  }
  const Point3 to{
      static_cast<Nm>(machine.bed.size_mm[0] * 5e5 - static_cast<double>(made.bounds.width()) / 2) - made.bounds.lo.x,
      static_cast<Nm>(machine.bed.size_mm[1] * 5e5 - static_cast<double>(made.bounds.depth()) / 2) - made.bounds.lo.y,
      -made.bounds.lo.z};
  for (Instance& instance : made.instances) instance.offset = moved(instance.offset, to);
  made.bounds = {moved(made.bounds.lo, to), moved(made.bounds.hi, to)};
  return made;
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr double kSideMm = 8;
#else
constexpr double kSideMm = 16;
#endif

TEST(Replay, EveryClosedModelIsPrintedBitForBitOnEveryShippedProfile) {
  const char* const folder = std::getenv("LAMINA_MODELS");
  if (folder == nullptr) GTEST_SKIP() << "LAMINA_MODELS is not set: NO real part was printed on all machines";
  std::vector<ResolvedMachine> machines;
  for (const ShippedProfile& shipped : shipped_machines()) {
    machines.push_back(*resolve_profile(*read_machine(shipped.text, std::string(shipped.name))));
  }
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path().string());
  }
  std::atomic<int> parts{0}, layers{0};
  tbb::parallel_for(std::size_t{0}, files.size(), [&](std::size_t file) {
    load::LoadOptions options;
    options.repair = false;
    const auto part = load::load(files[file], options);
    if (!part.ok() || part->bounds.empty() || part->bounds.height() == 0) return;
    for (const Mesh& mesh : part->meshes) {
      if (!mesh.closed) return;
    }
    ++parts;
    for (const ResolvedMachine& resolved : machines) {
      // 16 mm are 500,000 pixels of 1200 dpi, a quarter of them under a sanitizer; the coarse machines print larger parts.
      const double dots = 25.4e6 / resolved.grid.line_nm;
      AxisPositions axis_positions =
          scaled(*part, std::min(kSideMm * 1200 / dots, 0.6 * resolved.machine.bed.size_mm[0]), resolved.machine);
      const auto rasterizer = raster::Rasterizer::build(axis_positions.meshes, axis_positions.instances, resolved.grid.image,
                                                        FillRule::kNonzero, false, true);
      ASSERT_TRUE(rasterizer.ok());
      raster::LayerScratch scratch;
      Runs runs;
      for (const double share : {0.07, 0.46, 0.83}) {
        const auto plane = static_cast<Nm>(static_cast<double>(axis_positions.bounds.height()) * share);
        rasterizer->layer(raster::Engine::kContours, plane, scratch, runs);
        const Written program = printed_parts::program_of(resolved, runs);
        const auto printed = printed_parts::verified(resolved, runs, program);
        ASSERT_TRUE(printed.ok()) << resolved.machine.name << " " << files[file] << ": " << printed.error().message;
        EXPECT_EQ(printed->drops, set_pixels(runs)) << files[file];
        layers += printed->drops > 0;
      }
    }
  });
  EXPECT_GE(parts, 20);
  EXPECT_GE(layers, 20 * 9 * 2);
}

TEST(Replay, EveryDialectSpeaksForAnyMountingDirectionAndBlockedNozzle) {
  for (std::uint32_t seed = 0; seed < 120; ++seed) {
    Random random(seed);
    const auto dialects = program::dialects();
    const program::Dialect& dialect = dialects[seed % dialects.size()];
    Machine machine = program::testing::random_machine(random, dialect.id, 2, dialect.max_nozzles);
    program::testing::fit_firmware(machine);
    const ResolvedMachine resolved = shrunk(machine, 60 + random() % 100, 60 + random() % 100);
    const Image image = random_image(random, resolved.grid.image.columns(), resolved.grid.image.rows());
    const Runs runs = runs_of(image);
    const Written program = printed_parts::program_of(resolved, runs);
    const auto printed = printed_parts::verified(resolved, runs, program);
    ASSERT_TRUE(printed.ok()) << dialect.id << " seed " << seed << ": " << printed.error().message;
    EXPECT_EQ(printed->drops, set_pixels(runs) - program.count.lost);
  }
}

/// Whether a fault says where: a swath and a step of it, or that the first of them has not been reached.
bool names_the_position(const std::string& fault) {
  static const std::regex position(
      "layer 7, (swath [0-9]+, (step -?[0-9]+|before its first step)|before its first swath|powder cycle"
      "|line [0-9]+ across, position [0-9]+ along, which no swath covers): .*");
  return std::regex_match(fault, position);
}

TEST(Replay, ATruncatedOrEditedProgramFailsWithTheLayerTheSwathAndTheStep) {
  std::vector<ResolvedMachine> machines;
  for (const program::Dialect& dialect : program::dialects()) {
    Machine machine = program::testing::small_machine(12, 90, 100, 100);
    machine.dialect = dialect.id;
    program::testing::fit_firmware(machine);
    machines.push_back(shrunk(machine, 80, 30));
  }
  for (const ShippedProfile& shipped : shipped_machines()) {
    machines.push_back(shrunk(*read_machine(shipped.text, std::string(shipped.name)), 160, 90));
  }
  for (std::size_t number = 0; number < machines.size(); ++number) {
    const ResolvedMachine& resolved = machines[number];
    const std::string name = resolved.machine.name + "/" + resolved.machine.dialect;
    Random random(5);
    Image image(resolved.grid.image.rows(), std::vector<int>(resolved.grid.image.columns(), 0));
    for (auto& row : image) {
      for (std::size_t c = 5; c + 5 < row.size(); ++c) row[c] = random() % 2;
    }
    const Runs runs = runs_of(image);
    const Written program = printed_parts::program_of(resolved, runs);
    ASSERT_TRUE(printed_parts::verified(resolved, runs, program).ok());
    std::size_t before_all = 0, cuts = 0;
    for (std::size_t length = 0; length < program.text.size(); length += 1 + program.text.size() / 97, ++cuts) {
      const auto printed = printed_parts::verified(resolved, runs, {program.text.substr(0, length), program.count});
      ASSERT_FALSE(printed.ok()) << name << " cut to " << length;
      EXPECT_EQ(printed.error().fault, Fault::kVerification);
      EXPECT_TRUE(names_the_position(printed.error().message)) << name << ": " << printed.error().message;
      before_all += printed.error().message.find("before its first swath") != std::string::npos;
    }
    EXPECT_LT(before_all * 4, cuts) << name;  // where the bed, the roller and the vats move
    // A pixel that the program does not know of: the place where it should have fired.
    Image other = image;
    other[20][40] ^= 1;
    const auto printed = printed_parts::verified(resolved, runs_of(other), program);
    ASSERT_FALSE(printed.ok());
    EXPECT_TRUE(names_the_position(printed.error().message)) << printed.error().message;
    EXPECT_NE(printed.error().message.find("column 40, row 20"), std::string::npos) << name << ": " << printed.error().message;
    if (number < program::dialects().size()) {
      EXPECT_NE(printed.error().message.find("layer 7, swath 1, step 40: "), std::string::npos) << printed.error().message;
    }
    // Any byte of the vectors changed: never a crash, hardly ever unnoticed, and the position is reported.
    std::size_t unnoticed = 0, tried = 0;
    const std::size_t stride = 13 + program.text.size() / 500;
    for (std::size_t at = program.text.size() / 4; at < program.text.size() * 3 / 4; at += stride, ++tried) {
      Written edited = program;
      edited.text[at] = static_cast<char>(edited.text[at] ^ 1);
      const auto replayed = printed_parts::verified(resolved, runs, edited);
      unnoticed += replayed.ok();
      if (!replayed.ok()) {
        EXPECT_TRUE(names_the_position(replayed.error().message)) << name << " byte " << at << ": " << replayed.error().message;
      }
    }
    EXPECT_LT(unnoticed * 3, tried) << name;  // numbers of speeds and of swaths print the same
  }
}

}  // namespace
}  // namespace lamina::pipeline
