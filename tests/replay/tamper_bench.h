// Programs of a layer with all care that their dialect can say, cut into lines and records that tests leave out or change.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "tests/program/machines.h"
#include "tests/replay/printed_parts.h"

namespace lamina::printed_parts {

/// Firing off the bed, wiping, and where the machine's dialect can say it a lamp, a pump, a cap and a roller that turns.
inline void all_maintenance_of(Machine& m) {
  const bool bar = m.dialect == "brundlefab", stops = m.dialect == "m578";
  m.bed.size_mm = {12, bar ? 12.0 : 20.0};
  m.motion.both_directions = !bar;
  m.maintenance.spit_layers = 7;
  m.maintenance.spit_drops = stops ? 3 : bar ? 5 : 40;
  m.maintenance.spit_mm = bar ? std::array{400.0, 0.0} : std::array{-45.0, -10.0};
  if (bar) return;
  m.maintenance.wipe_layers = 7;
  m.maintenance.wipe_mm = {{-45, -30, -45, -12}};
  if (m.dialect == "hp45") return;
  m.powder.dry_s = 2.5;
  m.powder.dry_on_lines = {"M106 S255"};
  m.powder.dry_off_lines = {"M107"};
  m.powder.roller_rpm = stops ? 0 : 350;
  m.maintenance.wipe_lines = {"M42 P4 S1", "M42 P4 S0"};
  m.maintenance.cap_mm = {{-50, -10}};
}

struct TamperBench {
  static constexpr std::uint32_t kLayers = 9;

  pipeline::ResolvedMachine resolved;
  Runs image;
  Program program;
  std::vector<std::string> pieces;  // lines; of binary programs records, heads of sweeps, segments

  explicit TamperBench(const std::string& machine, const std::function<void(Machine&)>& change = all_maintenance_of)
      : resolved(shipped(machine, change)) {
    const PixelGrid& grid = resolved.grid.image;
    program::testing::Image pixels(grid.rows(), std::vector<int>(grid.columns(), 0));
    const std::uint32_t left = grid.columns() / 3, edge = grid.rows() / 10;
    for (std::uint32_t r = edge; r < grid.rows() - edge; ++r) {
      for (std::uint32_t c = left; c < left + 9; ++c) pixels[r][c] = c != left + 4;
    }
    image = program::testing::runs_of(pixels);
    program = program_of(resolved, image);
    cut();
  }

  bool binary() const { return resolved.machine.dialect == "raw" || resolved.machine.dialect == "planes"; }
  std::size_t head_bytes(const std::string& piece) const {
    return resolved.machine.dialect == "raw" && is_segment(piece) ? 8 : std::min<std::size_t>(piece.size(), 36);
  }
  /// The program with a piece, or two, replaced.
  std::string with(std::size_t piece, const std::string& by, std::size_t count = 1) const {
    std::string text;
    for (std::size_t i = 0; i < pieces.size(); ++i) text += i == piece ? by : i > piece && i < piece + count ? "" : pieces[i];
    return text;
  }
  /// The n-th piece that begins so, from 0; from the end if negative.
  std::size_t find(std::string_view begin, int n = 0) const {
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      if (pieces[i].starts_with(begin)) found.push_back(i);
    }
    EXPECT_LT(n < 0 ? -n - 1 : n, static_cast<int>(found.size())) << begin;
    return found.at(static_cast<std::size_t>(n < 0 ? static_cast<int>(found.size()) + n : n));
  }
  /// What lamina verify says of a program whose hash the manifest has: "" if it takes it. `counts`: what it compares there
  std::string reported(const std::string& text) const {
    const auto found = count(text);
    if (!found.ok()) return found.error().message;
    static const std::string kOther = "other numbers than the manifest's";
    const auto good = count(program.text);
    const bool same = found->drops == good->drops && found->spat == good->spat && found->vats == good->vats &&
                      std::abs(found->microseconds - good->microseconds) <= 1;
    return same ? std::string() : kOther;
  }
  Result<replay::Count> count(const std::string& text) const {
    const PixelGrid& grid = resolved.grid.image;
    const auto machine = replay::VirtualMachine::build(resolved.machine, grid.columns(), grid.rows(), kLayers);
    if (!machine) return machine.error();
    return machine->replay(text, kLayer, image, program.count.moved, program.count.lost);
  }

 private:
  static bool is_segment(const std::string& piece) {
    return piece.size() > 8 && !(piece[0] >= 'A' && piece[0] <= 'Z' && piece[1] >= 'A' && piece[3] >= 'A');
  }
  std::uint32_t number_at(std::size_t at) const {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value |= std::uint32_t{static_cast<std::uint8_t>(program.text[at + i])} << (8 * i);
    return value;
  }
  // By the READMEs of raw and planes.
  void cut() {
    const std::string& text = program.text;
    const std::size_t vector = (resolved.grid.nozzles + 127) / 128 * 16;
    std::uint32_t segments = 0;
    for (std::size_t at = 0, size = 0; at < text.size(); at += size) {
      const std::string tag = text.substr(at, 4);
      if (!binary()) {
        size = text.find('\n', at) + 1 - at;
      } else if (segments > 0) {
        size = 8 + vector * number_at(at + 4);
        --segments;
      } else if (tag == "LAYR" || tag == "LEND") {
        size = tag == "LAYR" ? 24 : 8;
      } else if (tag == "SWTH") {
        size = 28;
        segments = number_at(at + 24);
      } else {
        size = 8 + 4 * std::size_t{number_at(at + 4)};
      }
      pieces.push_back(text.substr(at, size));
    }
  }
};

}  // namespace lamina::printed_parts
