// stages/program/fire_drops.h: lines of a drop image under the nozzles of one sweep become the vectors that fire them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/drop_image.h"
#include "stages/data/program.h"

namespace lamina::program {

/// One line as runs of zones (data/drop_image.h); empty if its nozzle has nothing to fire.
struct DropLine {
  std::span<const std::uint32_t> change;  // two a run
  const std::uint8_t* zone = nullptr;     // one a run
  const DropPatterns* patterns = nullptr;
  std::uint32_t row = 0;                      // of the patterns
  std::uint64_t allowed = ~std::uint64_t{0};  // bit p % 64: whether this sweep fires position p
};

struct DropScratch {
  Buffer<std::uint64_t> rows;  // lines of bits of a block of steps, for each bit of the drops
  Buffer<std::uint64_t> of_residue;
  std::vector<std::uint32_t> next;  // run of each nozzle
  std::uint64_t bytes() const { return bytes_held(rows) + bytes_held(of_residue) + next.capacity() * sizeof(std::uint32_t); }
};

struct FiredDrops {
  std::uint64_t drops = 0;
  std::uint32_t maximum = 0;  // of a nozzle at a position
};

/// Drops of a pixel that has `drops` of them which a sweep fires whose first one is number `first`, from 0.
constexpr std::uint32_t drops_in_sweep(const HeadGrid& grid, std::uint32_t drops, std::uint32_t first) {
  const std::uint32_t left = drops > first ? drops - first : 0;
  return left < grid.sweep_drops ? left : grid.sweep_drops;
}

/// As fire(), of the drops from number `first` on.
/// line  one for each nozzle
/// cost  O(runs), one write and one read of each 64 pixels, and a transposition of each 64 x 64 of them that are not empty
bool fire_drops(const HeadGrid& grid, std::span<const DropLine> line, std::uint32_t first, DropScratch& scratch,
                SweepVectors& vectors, FiredDrops& fired);

}  // namespace lamina::program
