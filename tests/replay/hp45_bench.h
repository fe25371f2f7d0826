// Machines, images, programs and the firmware's port for tests of the dialects hp45 and oasis.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/machine/profiles.h"
#include "stages/replay/machine.h"
#include "tests/program/machines.h"
#include "tests/replay/hp45_port.h"
#include "tests/replay/printed_parts.h"

namespace lamina::hp45_bench {

using pipeline::resolve_profile;
using pipeline::ResolvedMachine;
using printed_parts::program_of;
using Lines = std::vector<std::string>;
using LayerProgram = printed_parts::Program;

inline Machine shipped_by_name(const std::string& name) { return *pipeline::find_machine(name); }

inline Result<replay::Count> verdict(const ResolvedMachine& resolved, const RunsView& image, const std::string& text,
                                     const ProgramCount& count) {
  return printed_parts::verified(resolved, image, {text, count});
}

using Pixel = std::pair<std::int64_t, std::int64_t>;  // column, row

inline Pixel pixel_of(const ResolvedMachine& resolved, const replay::VirtualMachine& machine,
                      const firmware::Hp45Port::Findings& detected, std::uint32_t nozzle) {
  const HeadGrid& grid = resolved.grid;
  const auto& mount = resolved.machine.mounting;
  const bool x = grid.scan_axis == ScanAxis::kX;
  const double line_0 = grid.line_position_nm(0), line_1 = grid.line_position_nm(1);
  const double step_0 = grid.step_position_nm(0), step_1 = grid.step_position_nm(1);
  const double line = ((detected.across_mm - mount.offset_mm[x ? 1 : 0]) * 1e6 - line_0) / (line_1 - line_0);
  const double step = ((detected.along_um / 1000 - mount.offset_mm[x ? 0 : 1]) * 1e6 - step_0) / (step_1 - step_0);
  const auto [column, row] = machine.nozzle_at(std::llround(line), std::round(step), nozzle);
  return {std::llround(column), std::llround(row)};
}

inline firmware::Hp45Port port_of(const ResolvedMachine& resolved) {
  const HeadGrid& grid = resolved.grid;
  const bool x = grid.scan_axis == ScanAxis::kX;
  const auto& motion = resolved.machine.motion;
  const double offset = resolved.machine.mounting.offset_mm[x ? 0 : 1];
  firmware::Hp45Port port(x ? motion.x_axis[0] : motion.y_axis[0], x ? motion.y_axis[0] : motion.x_axis[0],
                          grid.step_position_nm(0) / 1000 + offset * 1000, grid.step_nm() / 1000);
  port.tick_us = 2500 / motion.scan_speed_mm_s;  // 2.5 um
  return port;
}

inline Lines lines_of(const std::string& text) {
  Lines lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

inline std::string text_of(const Lines& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

/// The n-th line that begins so, from 0; from the end if negative.
inline std::size_t index_of_line(const Lines& lines, std::string_view begin, int n = 0) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].starts_with(begin)) found.push_back(i);
  }
  return found.at(static_cast<std::size_t>(n < 0 ? static_cast<int>(found.size()) + n : n));
}

inline bool all_off(const std::string& line) { return line.ends_with(" " + std::string(50, 'A')); }

/// A disc with a slot and a hole, over two swaths.
inline Runs slotted_disc(const PixelGrid& grid) {
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

/// The slotted disc on a machine like hp45 with a small bed, and its program.
struct SlottedDisc {
  ResolvedMachine resolved;
  Runs image;
  LayerProgram program;
  Lines lines = lines_of(program.text);

  /// bed  mm
  explicit SlottedDisc(const std::array<double, 2>& bed) : SlottedDisc(bed, [](Machine&) {}) {}
  /// change  of the machine
  template <class Change>
  SlottedDisc(const std::array<double, 2>& bed, const Change& change)
      : resolved(resolve(bed, change)), image(slotted_disc(resolved.grid.image)), program(program_of(resolved, image)) {}

  /// What verify says of other lines.
  Result<replay::Count> verdict_of(const Lines& other) const { return verdict(resolved, image, text_of(other), program.count); }

 private:
  template <class Change>
  static ResolvedMachine resolve(const std::array<double, 2>& bed, const Change& change) {
    Machine machine = shipped_by_name("hp45");
    machine.bed.size_mm = bed;
    change(machine);
    return *resolve_profile(machine);
  }
};

}  // namespace lamina::hp45_bench
