// stages/stokes/cells.h: the void of a box of voxels as cells of a fluid that know their neighbours.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/data/voxels.h"

namespace lamina::stokes {

/// Where a voxel lies, in voxels of the flow.
using CellIndex = std::array<std::uint32_t, 3>;

/// Voxels that a fluid passes, numbered by blocks of 2 x 2 x 2 and blocks of these, as G. M. Morton has it (1966). A cell holds
/// the pressure in its middle and, for each axis, the velocity through its upper face along that axis: a staggered grid.
/// Velocity exists on faces whose middles are in the void; elsewhere it is zero.
///
/// neighbour  of each cell below and above along x, y, z; size() where there is none: a wall, or the end of the box
/// hold       of each cell's three faces, how much more walls resist the velocity there than neighbours would, in units of
///            kHold; kShut if there is no velocity. Then what a pressure of 1 in this cell alone lets out of it, at
///            least a fifth: 1 far from walls
struct Cells {
  using Hold [[gnu::vector_size(8)]] = std::uint16_t;
  static constexpr float kHold = 1.0f / 1024;
  static constexpr std::uint16_t kShut = 65535;

  std::array<std::uint32_t, 3> box{};  // voxels
  std::array<double, 3> edge{};        // of a voxel, in units of the shortest one
  double unit_m = 0;                   // that one
  Buffer<std::array<std::uint32_t, 6>> neighbour;
  Buffer<Hold> hold;

  std::uint32_t size() const { return static_cast<std::uint32_t>(hold.size()); }
  std::uint64_t voxels() const { return std::uint64_t{box[0]} * box[1] * box[2]; }
};

/// Blocks of up to 2 x 2 x 2 cells, and blocks of these: for the coarse levels of a solver.
///
/// begin  size() + 1 entries; group g owns begin[g] .. begin[g + 1] - 1 of the level below
struct Groups {
  Buffer<std::uint32_t> begin;
  std::uint32_t size() const { return static_cast<std::uint32_t>(begin.size() - 1); }
};

/// The cells of a box, and groups of them, each level coarser than the one before.
struct Grid {
  Cells cells;
  std::vector<Groups> levels;
};

/// fine    the solid in voxels whose edges are a factor of those of the flow
/// factor  odd; the number of fine voxels along each axis is a multiple of it
/// levels  at most so many; none has fewer than 64 groups
/// errors  kInput: no void, 2^31 cells and more, or a factor that is even or does not fill the box
/// cost    O(voxels); 33 bytes a cell, meanwhile 25 more and factor^3 / 8 + 1 a voxel
Result<Grid> make_grid(const VoxelView& fine, std::uint32_t factor, std::uint32_t levels);

/// The same of voxels whose faces are the walls.
inline Result<Grid> make_grid(const VoxelView& solid, std::uint32_t levels) { return make_grid(solid, 1, levels); }

/// The voxels in which the cells of such a grid lie, in their order. cost  O(cells log cells); 28 bytes a cell
Buffer<CellIndex> cell_positions(const VoxelView& fine, std::uint32_t factor);

// --- loops and sums over cells that give the same digits for any number of threads; internal to stokes.

inline constexpr std::uint32_t kTogether = 4096;  // cells or groups a task

/// Calls work(begin, end) for pieces of [0, count), in parallel.
template <class Work>
void for_pieces(std::uint32_t count, const Work& work) {
  tbb::parallel_for(std::uint32_t{0}, (count + kTogether - 1) / kTogether,
                    [&](std::uint32_t piece) { work(piece * kTogether, std::min(count, (piece + 1) * kTogether)); });
}

/// The sum of what work(begin, end) gives for the pieces, taken in their order.
template <class Work>
double sum_of_pieces(std::uint32_t count, const Work& work) {
  Buffer<double> sums((count + kTogether - 1) / kTogether);
  for_pieces(count, [&](std::uint32_t begin, std::uint32_t end) { sums[begin / kTogether] = work(begin, end); });
  double sum = 0;
  for (const double piece : sums) sum += piece;
  return sum;
}

/// Calls work(i) for each of `count` cells, in parallel.
template <class Work>
void for_cells(std::uint32_t count, const Work& work) {
  for_pieces(count, [&work](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) work(i);
  });
}

/// The sum of value(i) of `count` cells, piece by piece.
template <class Value>
double sum_of_cells(std::uint32_t count, const Value& value) {
  return sum_of_pieces(count, [&value](std::uint32_t begin, std::uint32_t end) {
    double sum = 0;
    for (std::uint32_t i = begin; i < end; ++i) sum += value(i);
    return sum;
  });
}

}  // namespace lamina::stokes
