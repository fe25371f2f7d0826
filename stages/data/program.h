// stages/data/program.h: what passes between the compiler of print programs and the writers of dialects.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"

namespace lamina {

/// The bed as the head sees it. Lines run along the scan and count from the side where nozzle 0 lies; places along a
/// line count pixels from the side where forward sweeps begin. Steps are what the head moves between two firings:
/// pixels, or the ticks that a pixel is divided into.
///
/// Nozzle i of a sweep that begins at line f is over line f + i * passes. At step s it is over the pixel at place
/// (s - lag[i]) / steps_per_pixel, if that is whole; so pixel c of its line is fired at step c * steps_per_pixel + lag[i].
struct HeadGrid {
  PixelGrid image;
  ScanAxis scan_axis = ScanAxis::kX;
  bool lines_from_end = false;      // line 0 is the last image row (x) or column (y)
  bool positions_from_end = false;  // place 0 is at the right (x) or at the back (y), else at the left or at the front
  std::uint32_t lines = 0, positions = 0;
  std::uint32_t nozzles = 0, passes = 1, overlap = 0, joint_shift = 0, steps_per_pixel = 1;
  std::vector<std::uint32_t> lag;  // steps, the least is 0
  std::uint32_t max_lag = 0;
  std::uint32_t head_drops = 1;   // most drops that a nozzle can fire on a pixel in one sweep
  std::uint32_t sweep_drops = 1;  // that it does at the scan's speed, within its frequency
  std::uint32_t drop_bits = 1;    // of their number in vectors: 1, 2 or 4, by head_drops
  std::uint32_t bit_order = 0;    // of vectors: nozzle i is bit i ^ bit_order, as the dialect has it; below 128
  FirstSwath first_swath = FirstSwath::kBed;
  bool both_directions = false;
  std::vector<std::uint32_t> blocked;  // increasing
  BlockedRule blocked_rule = BlockedRule::kReport;

  // --- for reports and positions
  double line_nm = 0, position_nm = 0;              // pitch of pixels across and along the scan
  double angle_deg = 90;                            // between the row of nozzles and the scan
  double lag_pixels = 0;                            // from one nozzle to the next, exactly
  double worst_position_nm = 0, worst_line_nm = 0;  // how far a drop lands from the centre of its pixel, at most

  double step_nm() const { return position_nm / steps_per_pixel; }
  std::uint32_t swath_lines() const { return nozzles * passes; }
  /// Of 64 bits a vector, for one bit of the drops.
  std::uint32_t words() const { return bit_order < 64 ? (nozzles + 63) / 64 : (nozzles + 127) / 128 * 2; }
  /// Steps of a sweep over a whole line, the first one 0.
  std::uint64_t steps() const { return (std::uint64_t{positions} - 1) * steps_per_pixel + 1 + max_lag; }
  /// Swaths of a layer whose first one begins at the line `first`, before the bed's if joints are shifted.
  std::uint32_t swaths(std::int64_t first) const {
    const std::int64_t left = lines - first, all = swath_lines();
    return left <= all ? 1 : static_cast<std::uint32_t>(1 + (left - all + (all - overlap) - 1) / (all - overlap));
  }
  /// Sweeps over a place that its drops take.
  std::uint32_t sweeps_for(std::uint32_t drops) const { return (drops + sweep_drops - 1) / sweep_drops; }
  /// The most that a layer can have.
  std::uint32_t max_swaths() const { return swaths(0) + (joint_shift > 0 ? 1 : 0); }
  /// Bed coordinates in nm (x or y) of a line and of the lag-free nozzle at a step. Lines may lie outside of the bed.
  double line_position_nm(std::int64_t line) const {
    const PixelAxis& axis = scan_axis == ScanAxis::kX ? image.y : image.x;
    // Image rows count from the back, geometry from the front.
    const bool from_far = scan_axis == ScanAxis::kX ? !lines_from_end : lines_from_end;
    const double near = (static_cast<double>(line) + 0.5) * line_nm;
    return from_far ? static_cast<double>(axis.count) * line_nm - near : near;
  }
  double step_position_nm(double step) const {
    const PixelAxis& axis = scan_axis == ScanAxis::kX ? image.x : image.y;
    const double near = 0.5 * position_nm + step * step_nm();
    return positions_from_end ? static_cast<double>(axis.count) * position_nm - near : near;
  }
};

/// One movement of the head over the bed.
struct Sweep {
  std::uint32_t number = 0, of = 0;   // among all sweeps of the layer, those that are skipped included
  std::uint32_t swath = 0, pass = 0;  // pass >= HeadGrid::passes: a further one for blocked nozzles
  bool backward = false;              // steps run downwards
  std::int64_t first_line = 0;        // of nozzle 0; negative or behind the last line where a further pass needs it
  std::uint32_t drop = 0;             // of a pixel, from 0: the first one that this sweep can fire
  std::uint32_t drops = 1;            // the most of a nozzle at a place
  bool added = false;                 // not needed if nozzles fired all of their drops at the scan's speed
  bool repeated = false;              // fires what the sweep before it did, of the drops that follow those
};

/// What the nozzles do in a sweep.
/// bits    steps x words; nozzle i is bit b % 64 of word b / 64 of a step, b = i ^ HeadGrid::bit_order. Of heads that fire
///         several drops a step has HeadGrid::drop_bits such vectors, one behind the other: those of the lowest bit of the
///         number of drops first
/// firing  begin, end, begin, end, ... of the stretches of steps that fire something, from the first step, which does, as
///         does the last one
struct SweepVectors {
  std::uint32_t first_step = 0, steps = 0, words = 0;
  Buffer<std::uint32_t> firing;
  Buffer<std::uint64_t> bits;

  const std::uint64_t* step(std::uint32_t s) const { return bits.data() + std::size_t{s - first_step} * words; }
};

/// What a layer's program does, counted while it is compiled.
struct ProgramCount {
  std::uint32_t sweeps = 0, skipped = 0;  // skipped ones would have fired nothing
  std::uint32_t added = 0;                // Sweep::added, of those that fire
  std::uint64_t drops = 0, vectors = 0;   // vectors: steps at which something fires
  std::uint64_t moved = 0, lost = 0;      // pixels of blocked nozzles: fired by a neighbour instead, or not at all
};

/// The data of a layer for the machine in addition to its vectors.
struct LayerCycle {
  std::uint32_t layer = 0, layers = 0;
  std::int64_t bottom_nm = 0, thickness_nm = 0;
  std::vector<std::uint32_t> feeds{0};  // vats, from 0, that give powder to it
  bool refill = false;                  // the program pauses before it, for the vats to be filled
};

}  // namespace lamina
