// stages/program/compile.h: one layer's image becomes the sweeps that jet it.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <vector>

#include "stages/data/drop_image.h"
#include "stages/data/program.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/program/fire.h"
#include "stages/program/fire_drops.h"
#include "stages/program/lines.h"

namespace lamina::program {

/// Kept from layer to layer.
struct CompileScratch {
  ScanScratch scan;
  FireScratch fire;
  SweepVectors vectors;
  Buffer<ColumnChanges> line;              // every line of the layer
  std::vector<ColumnChanges> nozzle;       // what is under each nozzle of a sweep
  std::deque<Buffer<std::uint32_t>> made;  // lines that are not those of the image: shared or moved ones
  std::size_t made_used = 0;
  // --- of drop images
  DropScratch drop;
  std::vector<DropLine> drop_nozzle;
  DropPatterns whole;                   // zone n: n drops
  std::map<std::uint32_t, Levels> own;  // lines of whole drops that are not those of the image, by number; of one row

  std::uint64_t bytes() const {
    std::uint64_t total = bytes_held(fire.event_offset) + bytes_held(fire.event_bit) + bytes_held(fire.rows) +
                          bytes_held(fire.current) + bytes_held(vectors.bits) + bytes_held(vectors.firing) + bytes_held(line) +
                          nozzle.capacity() * sizeof(ColumnChanges) + scan.bytes() + drop.bytes() +
                          drop_nozzle.capacity() * sizeof(DropLine) + whole.bytes();
    for (const Buffer<std::uint32_t>& one : made) total += bytes_held(one);
    for (const auto& [number, levels] : own) total += levels.bytes();
    return total;
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

/// The same for pixels that get the drops of a drop image: a sweep fires up to grid.sweep_drops of them, and every sweep of the
/// head is made as often as the drops take before the next one, so that the drops of a pixel follow each other closely.
/// drops  at least as many as any pixel of the job gets
/// cost   of fire_drops() for each sweep that fires other drops than the one before it
Result<ProgramCount> compile(const HeadGrid& grid, const DropImageView& image, std::uint32_t drops, CompileScratch& scratch,
                             const EmitSweep& emit, std::uint32_t layer = 0);

}  // namespace lamina::program
