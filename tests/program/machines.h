// Machines and images for tests of print programs.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/runs.h"
#include "stages/program/head_grid.h"

namespace lamina::program::testing {

/// std::mt19937, whose numbers are wider than 32 bits on some platforms.
class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  std::uint32_t operator()() { return static_cast<std::uint32_t>(engine_()); }

 private:
  std::mt19937 engine_;
};

using Image = std::vector<std::vector<int>>;  // rows from the back of the bed, 0 or 1

inline Runs runs_of(const Image& image) {
  Runs runs;
  runs.columns = image.empty() ? 0 : static_cast<std::uint32_t>(image[0].size());
  runs.row_offset.push_back(0);
  for (const auto& row : image) {
    int before = 0;
    for (std::uint32_t c = 0; c < runs.columns; ++c) {
      if (row[c] != before) runs.change.push_back(c);
      before = row[c];
    }
    if (before != 0) runs.change.push_back(runs.columns);
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

/// A machine of n nozzles whose bed is about columns x rows of its own pixels.
inline Machine small_machine(std::uint32_t nozzles, double tilt_deg, double columns, double rows) {
  Machine machine;
  machine.name = "test";
  machine.head.nozzles = nozzles;
  machine.mounting.tilt_deg = tilt_deg;
  machine.motion.scan_speed_mm_s = 10;
  const double pitch = machine.head.pitch_um * 1e-3 * std::sin(tilt_deg * 3.14159265358979 / 180);
  machine.bed.size_mm = {columns * pitch - 1e-4, rows * pitch - 1e-4};
  return machine;
}

/// Gives a machine the features of its dialect's firmware, in addition to nozzles: the dots, axes and position of its head.
inline void fit_firmware(Machine& machine) {
  if (machine.dialect == "hp45" || machine.dialect == "oasis") {
    machine.motion.scan_speed_mm_s = 30;
    for (const std::uint32_t nozzle : {0u, 6u, 56u, 115u, 127u, 129u, 167u, 256u, 263u, 291u}) {
      if (nozzle < machine.head.nozzles) machine.head.blocked.push_back(nozzle);
    }
  }
  if (machine.dialect != "brundlefab") return;
  const bool x = machine.mounting.scan_axis == ScanAxis::kX;
  machine.mounting.along_dpi = 96;
  machine.mounting.offset_mm = {x ? 20 * 25.4 / 96 : 300, x ? 300 : 20 * 25.4 / 96};
  machine.motion.x_axis = x ? "Y" : "X";
  machine.motion.y_axis = x ? "X" : "Y";
  machine.powder.feed_axes = {"E", "A"};
  machine.powder.roller_axis = "X";
}

/// Kinds: sparse dots, solid blocks, half of all pixels, empty, full.
inline Image random_image(Random& random, std::uint32_t columns, std::uint32_t rows) {
  Image image(rows, std::vector<int>(columns, 0));
  const unsigned kind = random() % 6;
  if (kind == 0) return image;
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t c = 0; c < columns; ++c) {
      image[r][c] = kind == 1 ? 1 : kind == 2 ? random() % 50 == 0 : kind == 3 ? random() % 2 : kind == 4 ? (r + c) % 2 : 0;
    }
  }
  for (unsigned block = 0; kind == 5 && block < 5; ++block) {
    const std::uint32_t left = random() % columns, top = random() % rows;
    const std::uint32_t right = left + random() % (columns - left) + 1, bottom = top + random() % (rows - top) + 1;
    for (std::uint32_t r = top; r < bottom; ++r) {
      for (std::uint32_t c = left; c < right; ++c) image[r][c] = 1;
    }
  }
  return image;
}

/// A head that is moved step by step: counts the drops on every pixel from nothing but where nozzles are in nm.
class SlowHead {
 public:
  SlowHead(const Machine& machine, const HeadGrid& grid)
      : machine_(machine), grid_(grid), fired(grid.image.rows(), std::vector<int>(grid.image.columns(), 0)) {
    const double angle = grid_.angle_deg * 3.14159265358979323846 / 180, pitch = machine_.head.pitch_um * 1000;
    const auto& offsets = machine_.head.row_offset_um;
    for (std::uint32_t i = 0; i < grid_.nozzles; ++i) {
      const double k = machine_.mounting.first_leads ? i : grid_.nozzles - 1.0 - i;
      const double offset = offsets[i % offsets.size()] * 1000;
      behind_.push_back(k * pitch * std::cos(angle) + offset * std::sin(angle));
      across_.push_back(i * pitch * std::sin(angle) - offset * std::cos(angle));
    }
    const double minimum = *std::min_element(behind_.begin(), behind_.end());
    for (double& behind : behind_) behind -= minimum;
  }

  void sweep(const Sweep& sweep, const SweepVectors& vectors) {
    for (std::uint32_t s = vectors.first_step; s < vectors.first_step + vectors.steps; ++s) {
      for (std::uint32_t i = 0; i < grid_.nozzles; ++i) {
        if ((vectors.step(s)[i / 64] >> (i % 64) & 1) == 0) continue;
        ++drops;
        const bool blocked =
            std::find(machine_.head.blocked.begin(), machine_.head.blocked.end(), i) != machine_.head.blocked.end();
        if (blocked) ++blocked_drops;
        drop(sweep, s, i);
      }
    }
  }

 private:
  void drop(const Sweep& sweep, std::uint32_t step, std::uint32_t nozzle) {
    const double along = step * grid_.step_nm() - behind_[nozzle];  // from the centre of place 0
    const double across = static_cast<double>(sweep.first_line) * grid_.line_nm + across_[nozzle];
    const double position = along / grid_.position_nm, line = across / grid_.line_nm;
    // The nearest place; lags are rounded half down, so that a drop half way between two belongs to the farther one.
    const auto p = static_cast<std::int64_t>(std::floor(position + 0.5 + 1e-6));
    const auto l = static_cast<std::int64_t>(std::llround(line));
    if (p < 0 || l < 0 || p >= grid_.positions || l >= grid_.lines) {
      ++outside;
      return;
    }
    const bool x = machine_.mounting.scan_axis == ScanAxis::kX;
    const auto side = [&](Side s) { return machine_.mounting.scan_from == s || machine_.mounting.nozzle_0 == s; };
    std::int64_t column = x ? p : l, from_back = x ? l : p;
    if (side(Side::kRight)) column = grid_.image.columns() - 1 - column;
    if (side(Side::kFront)) from_back = grid_.image.rows() - 1 - from_back;
    ++fired[static_cast<std::size_t>(from_back)][static_cast<std::size_t>(column)];
  }

  const Machine& machine_;
  const HeadGrid& grid_;
  std::vector<double> behind_, across_;  // nm, of each nozzle

 public:
  std::vector<std::vector<int>> fired;
  std::uint64_t drops = 0, outside = 0, blocked_drops = 0;
};

/// A machine of a dialect with any mounting, direction and rules, and a blocked nozzle. max_nozzles  of the dialect
inline Machine random_machine(Random& random, std::string_view dialect, std::uint32_t min_nozzles, std::uint32_t max_nozzles) {
  Machine machine = small_machine(std::min(min_nozzles + random() % 130, max_nozzles), 90, 100, 100);
  machine.dialect = dialect;
  const bool x = random() % 2 == 0;
  auto& mounting = machine.mounting;
  mounting.tilt_deg = std::array{90.0, 45.0, 31.0, 120.0}[random() % 4];
  if (!x) mounting.tilt_deg = 90 - mounting.tilt_deg;
  mounting.scan_axis = x ? ScanAxis::kX : ScanAxis::kY;
  mounting.scan_from = x ? (random() % 2 ? Side::kLeft : Side::kRight) : (random() % 2 ? Side::kFront : Side::kBack);
  mounting.nozzle_0 = x ? (random() % 2 ? Side::kBack : Side::kFront) : (random() % 2 ? Side::kLeft : Side::kRight);
  mounting.first_leads = random() % 2;
  mounting.passes = 1 + random() % 2;
  mounting.first_swath = random() % 2 ? FirstSwath::kBed : FirstSwath::kLayer;
  mounting.overlap_lines = random() % (machine.head.nozzles / 2 + 1);
  mounting.joint_shift_lines = random() % 3 * 5;
  mounting.offset_mm = {12.5, -3.25};
  machine.motion.both_directions = random() % 2;
  machine.head.blocked = {random() % machine.head.nozzles};
  machine.head.blocked_rule = static_cast<BlockedRule>(random() % 3);
  return machine;
}

}  // namespace lamina::program::testing
