// Programs for the HP45 controller against its firmware: the decoder of stages/replay/hp45 and the port beside this file.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <tuple>

#include "pipeline/machine/powder_printer.h"
#include "pipeline/machine/profiles.h"
#include "stages/load/load.h"
#include "stages/program/compile.h"
#include "stages/raster/raster.h"
#include "stages/replay/hp45/controller.h"
#include "stages/replay/machine.h"
#include "stages/write/program/dialect.h"
#include "tests/program/machines.h"
#include "tests/replay/hp45_port.h"
#include "tests/replay/printed_parts.h"

namespace lamina::pipeline {
namespace {

using Lines = std::vector<std::string>;

Machine shipped_by_name(std::string_view name) {
  for (const ShippedProfile& shipped : shipped_machines()) {
    if (shipped.name == name) return *read_machine(shipped.text, std::string(name));
  }
  throw std::logic_error("no such machine");
}

using LayerProgram = printed_parts::Program;
using printed_parts::program_of;

Result<replay::Count> verdict(const ResolvedMachine& resolved, const RunsView& image, const std::string& text,
                              const ProgramCount& count) {
  const PixelGrid& grid = resolved.grid.image;
  return replay::VirtualMachine::build(resolved.machine, grid.columns(), grid.rows())
      ->replay(text, {7, 700'000, 100'000}, image, count.moved, count.lost);
}

/// What the port fires, beside the pixels that are wanted: those that no drop falls on, drops beside them, and on the way
/// between sweeps.
struct Difference {
  std::uint64_t missing = 0, added = 0, fired = 0;
};

using Pixel = std::pair<std::int64_t, std::int64_t>;  // column, row

Pixel pixel_of(const ResolvedMachine& resolved, const replay::VirtualMachine& machine, const firmware::Hp45Port::Seen& seen,
               std::uint32_t nozzle) {
  const HeadGrid& grid = resolved.grid;
  const auto& mount = resolved.machine.mounting;
  const bool x = grid.scan_axis == ScanAxis::kX;
  const double line_0 = grid.line_position_nm(0), line_1 = grid.line_position_nm(1);
  const double step_0 = grid.step_position_nm(0), step_1 = grid.step_position_nm(1);
  const double line = ((seen.across_mm - mount.offset_mm[x ? 1 : 0]) * 1e6 - line_0) / (line_1 - line_0);
  const double step = ((seen.along_um / 1000 - mount.offset_mm[x ? 0 : 1]) * 1e6 - step_0) / (step_1 - step_0);
  const auto [column, row] = machine.nozzle_at(std::llround(line), std::round(step), nozzle);
  return {std::llround(column), std::llround(row)};
}

bool is_set(const RunsView& image, const Pixel& pixel) {
  if (pixel.first < 0 || pixel.second < 0 || pixel.second >= image.rows() || pixel.first >= image.columns) return false;
  const auto row = image.row(static_cast<std::uint32_t>(pixel.second));
  return (std::upper_bound(row.begin(), row.end(), static_cast<std::uint32_t>(pixel.first)) - row.begin()) % 2 == 1;
}

firmware::Hp45Port port_of(const ResolvedMachine& resolved) {
  const HeadGrid& grid = resolved.grid;
  const bool x = grid.scan_axis == ScanAxis::kX;
  const auto& motion = resolved.machine.motion;
  const double offset = resolved.machine.mounting.offset_mm[x ? 0 : 1];
  firmware::Hp45Port port(x ? motion.x_axis[0] : motion.y_axis[0], x ? motion.y_axis[0] : motion.x_axis[0],
                          grid.step_position_nm(0) / 1000 + offset * 1000, grid.step_nm() / 1000);
  port.tick_us = 2500 / motion.scan_speed_mm_s;  // 2.5 um
  return port;
}

Difference port_difference(const ResolvedMachine& resolved, const RunsView& image, const std::string& text) {
  const PixelGrid& grid = resolved.grid.image;
  const auto machine = *replay::VirtualMachine::build(resolved.machine, grid.columns(), grid.rows());
  firmware::Hp45Port port = port_of(resolved);
  port.run(text);
  EXPECT_EQ(port.unknown, 0u);
  std::vector<bool> once(std::size_t{grid.columns()} * grid.rows());
  Difference difference;
  for (const auto& seen : port.shown) {
    for (std::uint32_t n = 0; n < 300; ++n) {
      if (!seen.nozzles[n]) continue;
      const Pixel pixel = pixel_of(resolved, machine, seen, 299 - n);
      ++difference.fired;
      const bool wanted = is_set(image, pixel);
      const std::size_t place = wanted ? static_cast<std::size_t>(pixel.second * grid.columns() + pixel.first) : 0;
      difference.added += !wanted || once[place];
      if (wanted) once[place] = true;
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

Lines lines_of(const std::string& text) {
  Lines lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string text_of(const Lines& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

/// The n-th line that begins so, from 0; from the end if negative.
std::size_t place_of_line(const Lines& lines, std::string_view begin, int n = 0) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].starts_with(begin)) found.push_back(i);
  }
  return found.at(static_cast<std::size_t>(n < 0 ? static_cast<int>(found.size()) + n : n));
}

bool all_off(const std::string& line) { return line.ends_with(" " + std::string(50, 'A')); }

/// A disc with a slot and a hole, over two swaths.
Runs slotted_disc(const PixelGrid& grid) {
  program::testing::Image image(grid.rows(), std::vector<int>(grid.columns(), 0));
  const double middle_x = grid.columns() / 2.0, middle_y = grid.rows() / 2.0, radius = std::min(middle_x, middle_y);
  for (std::uint32_t r = 0; r < grid.rows(); ++r) {
    for (std::uint32_t c = 0; c < grid.columns(); ++c) {
      const double far = std::hypot(c + 0.5 - middle_x, r + 0.5 - middle_y);
      image[r][c] = far < radius && far > radius * 0.3 && std::abs(c - middle_x * 0.5) > 20;
    }
  }
  return program::testing::runs_of(image);
}

TEST(Hp45, PlantedFaultsAreFound) {
  Machine machine = shipped_by_name("hp45");
  machine.bed.size_mm = {20, 20};
  const ResolvedMachine resolved = *resolve_profile(machine);
  const Runs image = slotted_disc(resolved.grid.image);
  const LayerProgram program = program_of(resolved, image);
  ASSERT_TRUE(verdict(resolved, image, program.text, program.count).ok());
  const Lines sound = lines_of(program.text);
  const std::size_t first = place_of_line(sound, "SBR"), second_sweep = place_of_line(sound, "BCL", 1);
  const std::size_t sweep_1 =
      first + static_cast<std::size_t>(std::find_if(sound.begin() + static_cast<std::ptrdiff_t>(first), sound.end(),
                                                    [](const auto& l) { return l[0] == 'G'; }) -
                                       (sound.begin() + static_cast<std::ptrdiff_t>(first)));
  const std::size_t gap =
      first + 1 +
      static_cast<std::size_t>(std::find_if(sound.begin() + static_cast<std::ptrdiff_t>(first) + 1, sound.end(), all_off) -
                               (sound.begin() + static_cast<std::ptrdiff_t>(first) + 1));
  ASSERT_LT(gap, sweep_1 - 1) << "no gap";
  const auto erase = [](Lines& lines, std::size_t at) { lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(at)); };
  // The position's last digit but one, up or down by one: 64 um.
  const auto shift = [](std::string& line, int by) {
    line[line.find(' ', 4) - 2] = static_cast<char>(line[line.find(' ', 4) - 2] + by);
  };
  const std::vector<std::pair<const char*, std::function<void(Lines&)>>> faults = {
      {"no all-off before the first line", [&](Lines& l) { erase(l, first); }},
      {"no all-off before a gap", [&](Lines& l) { erase(l, gap); }},
      {"no all-off at the end", [&](Lines& l) { erase(l, sweep_1 - 1); }},
      {"a change is missing", [&](Lines& l) { erase(l, first + 5); }},
      {"the first column is missing", [&](Lines& l) { erase(l, first + 1); }},
      {"the last column is missing", [&](Lines& l) { erase(l, sweep_1 - 2); }},
      {"a line is a pixel late",
       [&](Lines& l) { shift(l[first + 5], l[first + 5][l[first + 5].find(' ', 4) - 2] == 'z' ? -1 : 1); }},
      {"the whole sweep is shifted",
       [&](Lines& l) {
         for (std::size_t i = first; i < sweep_1; ++i) l[i][l[i].find(' ', 4) - 1] = 'A';
       }},
      {"the buffer is rewound", [&](Lines& l) { l[second_sweep] = "BRES"; }},
      {"the buffer is cleared before the sweep",
       [&](Lines& l) { l.insert(l.begin() + static_cast<std::ptrdiff_t>(sweep_1), "BCL"); }},
      {"a nozzle more", [&](Lines& l) { l[first + 1].back() = l[first + 1].back() == 'B' ? 'C' : 'B'; }},
      {"nozzles the other way round",
       [&](Lines& l) {
         for (auto& line : l)
           if (line.starts_with("SBR")) std::reverse(line.end() - 50, line.end());
       }},
      {"a character is missing", [&](Lines& l) { l[first + 9].pop_back(); }},
      {"a character that is no digit", [&](Lines& l) { l[first + 9].back() = '='; }},
      {"a swath is missing",
       [&](Lines& l) {
         l.erase(l.begin() + static_cast<std::ptrdiff_t>(second_sweep),
                 l.begin() + static_cast<std::ptrdiff_t>(place_of_line(l, "SBR", -1)) + 3);
       }},
      {"a sweep's movement is missing", [&](Lines& l) { erase(l, sweep_1); }},
      {"300 dpi", [&](Lines& l) { l[place_of_line(l, "SDP")] = "SDP Es"; }},
      {"half the density", [&](Lines& l) { l[place_of_line(l, "SDN")] = "SDN y"; }},
      {"another encoder", [&](Lines& l) { l[place_of_line(l, "SER")] = "SER Es"; }},
      {"one row of nozzles", [&](Lines& l) { l[place_of_line(l, "SSID")] = "SSID B"; }},
      {"a buffer that is kept", [&](Lines& l) { l[place_of_line(l, "BMOD")] = "BMOD B"; }},
      {"no wait before the lines", [&](Lines& l) { erase(l, place_of_line(l, "G4", 0)); }},
      {"no wait behind the sweep",
       [&](Lines& l) {
         erase(l, place_of_line(l, "G4", 2));
         erase(l, place_of_line(l, "G4", 1));
       }},
      {"the encoder is not zeroed", [&](Lines& l) { erase(l, place_of_line(l, "SEP")); }},
      {"the encoder is zeroed elsewhere", [&](Lines& l) { l[place_of_line(l, "SEP")] = "SEP A"; }},
      {"lines before the head is at its start",
       [&](Lines& l) {
         std::rotate(l.begin() + static_cast<std::ptrdiff_t>(first) - 4, l.begin() + static_cast<std::ptrdiff_t>(first),
                     l.begin() + static_cast<std::ptrdiff_t>(sweep_1));
       }},
      {"a sweep in parts of mm/s", [&](Lines& l) { l[sweep_1].replace(l[sweep_1].find(" F"), 7, " F14990"); }},
      // 20 mm/s are 472 counts a second.
      {"a sweep that the controller takes for rest", [&](Lines& l) { l[sweep_1].replace(l[sweep_1].find(" F"), 7, " F1200"); }},
      // 25,400 counts an inch and moves of metres would keep verify busy.
      {"another encoder behind the sweeps", [&](Lines& l) { l.insert(l.end() - 1, "SER GM4"); }},
      {"the head leaves the machine",
       [&](Lines& l) {
         l.insert(l.end() - 3, {"G1 X5000 F15000", "G1 X-5000 F15000"});
       }},
      {"the head goes to and fro over lines that are not done",
       [&](Lines& l) {
         l.insert(l.end() - 3, {"SBR ///// " + std::string(50, 'A'), "G1 X60 F15000"});
         for (int i = 0; i < 9; ++i) l.insert(l.end() - 3, i % 2 == 0 ? "G1 X10" : "G1 X60");
       }},
      {"the sweep ends early", [&](Lines& l) { l[sweep_1] = "G1 X40.0000 F15000"; }},
      {"the head goes over the lines backwards",
       [&](Lines& l) {
         std::reverse(l.begin() + static_cast<std::ptrdiff_t>(first), l.begin() + static_cast<std::ptrdiff_t>(sweep_1));
       }},
      {"a swath is a line beside its place",
       [&](Lines& l) {
         auto& g = l[first - 4];
         g.replace(g.find('Y'), g.find(" F") - g.find('Y'), "Y40.0365");
       }},
      {"the program ends early", [&](Lines& l) { l.pop_back(); }}};
  EXPECT_GE(faults.size(), 30u);
  for (const auto& [name, plant] : faults) {
    Lines lines = sound;
    plant(lines);
    ASSERT_NE(lines, sound) << name;
    const auto printed = verdict(resolved, image, text_of(lines), program.count);
    EXPECT_FALSE(printed.ok()) << name << " is not found";
    if (!printed.ok() && std::getenv("LAMINA_SHOW") != nullptr) std::printf("%s: %s\n", name, printed.error().message.c_str());
  }
}

TEST(Hp45, EncoderFarFinerThanPixelsIsFoundWhereTheProfileNamesNone) {
  Machine machine = shipped_by_name("hp45");
  machine.bed.size_mm = {20, 10};
  machine.motion.encoder_dpi = 0;
  const ResolvedMachine resolved = *resolve_profile(machine);
  const Runs image = slotted_disc(resolved.grid.image);
  const LayerProgram program = program_of(resolved, image);
  const auto sound = verdict(resolved, image, program.text, program.count);
  ASSERT_TRUE(sound.ok()) << sound.error().message;
  Lines lines = lines_of(program.text);
  lines[place_of_line(lines, "SER")] = "SER GM4";  // 25,400
  const auto printed = verdict(resolved, image, text_of(lines), program.count);
  ASSERT_FALSE(printed.ok());
  EXPECT_NE(printed.error().message.find("far more than pixels of 42.3 um need"), std::string::npos) << printed.error().message;
}

TEST(Hp45, DropsThatFallWhileTheHeadTravelsAreCounted) {
  Machine machine = shipped_by_name("hp45");
  machine.bed.size_mm = {20, 10};
  machine.head.blocked_rule = BlockedRule::kReport;  // a single sweep
  const ResolvedMachine resolved = *resolve_profile(machine);
  const Runs image = slotted_disc(resolved.grid.image);
  const LayerProgram program = program_of(resolved, image);
  Lines lines = lines_of(program.text);
  // The lines again behind the sweep: the head passes them on its way to where it waits, from X 50 to 0.
  lines.insert(lines.end() - 3, {"BRES", "G1 X10.0000 F15000", "G4 P0", "G1 X60.0000 F15000", "G4 P0"});
  const auto printed = verdict(resolved, image, text_of(lines), program.count);
  ASSERT_FALSE(printed.ok());
  EXPECT_NE(printed.error().message.find(std::to_string(program.count.drops) + " drops fall while the head travels"),
            std::string::npos)
      << printed.error().message;
}

// The example at the head of HP45_Standalone_V4.ino: a quarter of the nozzles for 10 mm each.
TEST(Hp45, AuthorsExampleFiresAQuarterOfTheNozzlesForTenMillimetresEach) {
  Machine machine = shipped_by_name("hp45");
  machine.mounting.offset_mm = {0, 0};
  const ResolvedMachine resolved = *resolve_profile(machine);
  Machine bare = machine;
  bare.head.blocked = {};
  const std::string off(50, 'A');
  const std::string program =
      "SPME\nSER JY\nSDP JY\nSDN Bk\nG1 X-20.32 Y" + std::to_string(resolved.grid.line_position_nm(0) / 1e6) +
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
    if (controller_.execute(command, rest).empty()) text += command + " " + rest + "\n";
  }
  void go(std::int64_t counts) {
    text += fmt::format("G1 X{:.6f} F15000\nG4 P0\n", static_cast<double>(counts) * 25.4 / 600);
    controller_.move(static_cast<double>(counts) * kCountUm, [&](const replay::hp45::Controller::Firing& firing) {
      const double least = std::min(firing.from_um, firing.to_um), most = std::max(firing.from_um, firing.to_um);
      for (auto k = static_cast<std::int64_t>(std::ceil(least / kCountUm));
           firing.steady && static_cast<double>(k) * kCountUm < most; ++k) {
        std::string nozzles;
        for (std::uint32_t place = 0; place < 300; ++place) {
          nozzles += ((*firing.burst)[place / 64] >> (63 - place % 64) & 1) != 0 ? '1' : '0';
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
TEST(Hp45, LongWaysOfAnIdleControllerChangeNothing) {
  const auto fired = [](std::int64_t counts, int times) {
    replay::hp45::Controller controller;
    std::string seen;
    const auto watch = [&](const replay::hp45::Controller::Firing& firing) {
      seen += fmt::format("{} {} {:.3f} {:.3f} {}\n", firing.row, firing.line, firing.from_um, firing.to_um, firing.steady);
    };
    for (int i = 0; i < times; ++i) {
      controller.move(static_cast<double>(counts) * Hp45Stream::kCountUm, watch);
      controller.move(0, watch);
    }
    EXPECT_EQ(controller.execute("SER", "JY"), "");
    EXPECT_EQ(controller.execute("SEP", "A"), "");
    for (const char* line : {"B9A ", "D6A ", "F3A "}) {
      const char nozzles = line[0] == 'D' ? 'B' : 'A';
      EXPECT_EQ(controller.execute("SBR", line + std::string(50, nozzles)), "");
    }
    controller.move(60'000, watch);
    return seen;
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
    const auto below = [&](std::uint32_t most) { return static_cast<std::int64_t>(random() % most); };
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
    for (const auto& seen : port.shown) {
      if (seen.steady)
        shown.emplace_back(seen.row, std::llround(seen.along_um / Hp45Stream::kCountUm), seen.nozzles.to_string());
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
  std::uint64_t drops = 0, beside = 0;
  for (const auto& seen : port.fired) {
    for (std::uint32_t n = 0; n < 300; ++n) {
      if (!seen.nozzles[n]) continue;
      const Pixel at = pixel_of(resolved, virtual_machine, seen, 299 - n);
      ++drops;
      beside += !is_set(image, at) && !is_set(image, {at.first - 1, at.second}) && !is_set(image, {at.first + 1, at.second});
    }
  }
  EXPECT_EQ(beside, 0u);
  EXPECT_NEAR(static_cast<double>(drops) / static_cast<double>(set_pixels(image)), 1, 0.03);
}

TEST(Hp45, WhatTheControllerCannotDoIsRefusedWithTheKey) {
  const auto refused = [](const std::function<void(Machine&)>& change, std::string_view key) {
    Machine machine = shipped_by_name("hp45");
    change(machine);
    const auto resolved = resolve_profile(machine);
    ASSERT_FALSE(resolved.ok()) << key;
    EXPECT_EQ(resolved.error().fault, Fault::kUsage);
    EXPECT_NE(resolved.error().message.find(key), std::string::npos) << resolved.error().message;
  };
  refused([](Machine& m) { m.head.row_offset_um = {0, 4050}; }, "head.row_offset_um");
  refused([](Machine& m) { m.head.blocked = {6, 56, 115, 127, 167, 256}; }, "head.blocked");
  for (const std::uint32_t nozzle : {0u, 6u, 56u, 115u, 127u, 129u, 167u, 256u, 263u, 291u}) {
    refused([&](Machine& m) { std::erase(m.head.blocked, nozzle); }, fmt::format("cannot fire nozzle {},", nozzle));
  }
  // 600 counts a second of a strip of 600 an inch are 25.4 mm/s.
  for (const double speed : {1.0, 25.0, 50.5, 249.99}) {
    refused([&](Machine& m) { m.motion.scan_speed_mm_s = speed; }, "motion.scan_speed_mm_s");
  }
  refused([](Machine& m) { m.motion.encoder_dpi = 1200, m.motion.scan_speed_mm_s = 12; }, "give 13 or a higher whole number");
  refused([](Machine& m) { m.bed.size_mm = {170, 100}; }, "bed.size_mm");
  refused([](Machine& m) { m.motion.encoder_dpi = 300; }, "motion.encoder_dpi");
  refused([](Machine& m) { m.motion.encoder_dpi = 650; }, "motion.encoder_dpi");
  refused([](Machine& m) { m.motion.encoder_dpi = 1200, m.motion.ticks_per_pixel = 2, m.motion.lag_unit = LagUnit::kTick; },
          "motion.lag_unit");
}

TEST(Hp45, HeadsOfHalfTheResolutionFireTwoNozzlesAsOne) {
  Machine machine = shipped_by_name("hp45");
  machine.head.nozzles = 150;
  machine.head.blocked = {};
  machine.head.pitch_um = 25'400.0 / 300;
  machine.mounting.dpi = 300;
  machine.bed.size_mm = {15, 20};
  const ResolvedMachine resolved = *resolve_profile(machine);
  const Runs image = slotted_disc(resolved.grid.image);
  const LayerProgram program = program_of(resolved, image);
  EXPECT_NE(program.text.find("SDP Es\nSDN y\n"), std::string::npos);
  const auto printed = verdict(resolved, image, program.text, program.count);
  ASSERT_TRUE(printed.ok()) << printed.error().message;
  EXPECT_EQ(printed->drops, set_pixels(image));
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
}  // namespace lamina::pipeline
