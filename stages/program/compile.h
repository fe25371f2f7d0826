// stages/program/compile.h: one layer's image becomes the sweeps that jet it.
#pragma once

#include <deque>
#include <functional>
#include <span>
#include <vector>

#include "stages/data/program.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/program/fire.h"
#include "stages/program/lines.h"

namespace lamina::program {

/// Kept from layer to layer.
struct CompileScratch {
  std::deque<ScanScratch> scan;  // of each plane
  FireScratch fire;
  SweepVectors vectors;
  Buffer<ColumnChanges> line;              // every line of the layer, plane after plane
  std::vector<ColumnChanges> nozzle;       // what is under each nozzle of a sweep, bit after bit of the drops
  std::deque<Buffer<std::uint32_t>> made;  // lines that are not those of the image: shared or moved ones
  std::size_t made_used = 0;
  DropBits bits;  // of heads that fire several drops in a sweep

  std::uint64_t bytes() const {
    std::uint64_t total = bytes_held(fire.event_offset) + bytes_held(fire.event_bit) + bytes_held(fire.rows) +
                          bytes_held(fire.current) + bytes_held(vectors.bits) + bytes_held(vectors.firing) + bytes_held(line) +
                          nozzle.capacity() * sizeof(ColumnChanges);
    for (const ScanScratch& one : scan) {
      total += bytes_held(one.turned.row_offset) + bytes_held(one.turned.change) + bytes_held(one.next);
    }
    for (const Buffer<std::uint32_t>& one : made) total += bytes_held(one);
    return total + bits.bytes();
  }
};

/// Called for every sweep that fires, in the order in which the machine makes them.
using EmitSweep = std::function<Status(const Sweep&, const SweepVectors&)>;

/// Compiles a layer. Every set pixel fires exactly once and no other one, for any angle, passes and overlap; with
/// blocked nozzles the difference is `lost` and `moved` of the result, by the rule of the grid.
///
/// image     of grid.image's size
/// swaths    from the first line of the bed or of the layer, each as many lines as the head has nozzles (times passes),
///           neighbours sharing `overlap` lines. A line that two swaths share is divided between them by an ordered
///           pattern of 64 positions that turns from line to line, whose share goes from all to none over the overlap.
///           Sweeps that would fire nothing are skipped; with both directions every other sweep that is left runs back.
/// layer     its swaths begin layer x grid.joint_shift lines earlier, modulo a swath less what it shares: stitch lines
///           of neighbouring layers are separated
/// blocked   lines that no nozzle of any swath can fire, by rule: left out; moved pixel by pixel to the line of the next
///           nozzle before or else behind it, where that pixel is free; or fired by further sweeps of the same swath with
///           the head shifted by whole nozzles, the shortest shift first.
/// errors    those of `emit`, which end the layer
/// cost      of fire() for each sweep; memory is one sweep's vectors
Result<ProgramCount> compile(const HeadGrid& grid, const RunsView& image, CompileScratch& scratch, const EmitSweep& emit,
                             std::uint32_t layer = 0);

/// The same for pixels of several drops: a sweep fires up to grid.sweep_drops of them, and every sweep of the head is made as
/// often as the planes take before the next one, so that the drops of a pixel follow each other closely.
/// planes  at least one; each lies within the one before it
Result<ProgramCount> compile(const HeadGrid& grid, std::span<const RunsView> planes, CompileScratch& scratch,
                             const EmitSweep& emit, std::uint32_t layer = 0);

}  // namespace lamina::program
