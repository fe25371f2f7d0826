// stages/stokes/cells.h: the void of a box of voxels as cells of a fluid that know their neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/data/voxels.h"

namespace lamina::stokes {

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
Buffer<std::array<std::uint32_t, 3>> cell_positions(const VoxelView& fine, std::uint32_t factor);

}  // namespace lamina::stokes
