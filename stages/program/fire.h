// stages/program/fire.h: the lines under the nozzles of one sweep become the vectors that fire them.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/program.h"

namespace lamina::program {

/// One line as places where its colour changes (data/runs.h); empty if its nozzle has nothing to fire.
using ColumnChanges = std::span<const std::uint32_t>;

struct FireScratch {
  Buffer<std::uint32_t> event_offset;
  Buffer<std::uint16_t> event_bit;  // of a vector, to be turned over
  Buffer<std::uint64_t> rows;       // 64 lines of bits
  Buffer<std::uint64_t> current;    // a vector for each residue of steps
  Buffer<std::uint32_t> lit;        // set bits of each of them
};

/// Two ways to the same bits, chosen by what they cost.
enum class FireWay : std::uint8_t { kCheapest, kChanges, kBlocks };

/// Fills `vectors` with the steps from the first to the last that fires. False if nothing fires.
///
/// lines  one for each nozzle, and of grid.drop_bits for each bit of the drops, the lowest first
/// cost   by changes: each line's changes sorted by step, and copies of the vector between them; nothing is expanded.
///        by blocks, for patterns with a change every few pixels: 64 lines at a time expanded to bits, and blocks of
///        64 x 64 of them transposed
bool fire(const HeadGrid& grid, std::span<const ColumnChanges> lines, FireScratch& scratch, SweepVectors& vectors,
          FireWay way = FireWay::kCheapest);

}  // namespace lamina::program
