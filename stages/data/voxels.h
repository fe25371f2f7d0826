// stages/data/voxels.h: a box of voxels as a stack of 1-bit images, each row as the columns where it changes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/runs.h"
#include "stages/data/units.h"

namespace lamina {

/// Borrowed runs of the set voxels of a box: those of the solid, unless said otherwise.
///
/// row_offset  ny nz + 1 entries; row y + ny z owns change[row_offset[row] .. row_offset[row + 1]). The first entry need not be
///             0: some slices of a box are a view of the same changes
/// change      of each row as in data/runs.h: begin, end, begin, end, ... strictly increasing, end <= nx
/// edge        nm, of a voxel along x, y and z; cubes are the rule
/// periodic    the box repeats along x, y, z: its last voxel has the first as a neighbour
/// x is the column of an image, y its row as the image has it (data/runs.h), z the number of the slice, from below.
struct VoxelView {
  std::uint32_t nx = 0, ny = 0, nz = 0;
  std::array<Nm, 3> edge{1, 1, 1};
  std::array<bool, 3> periodic{};
  std::span<const std::uint32_t> row_offset;
  std::span<const std::uint32_t> change;

  std::size_t rows() const { return std::size_t{ny} * nz; }
  std::array<std::uint32_t, 3> size() const { return {nx, ny, nz}; }
  std::uint64_t voxels() const { return std::uint64_t{nx} * ny * nz; }
  std::span<const std::uint32_t> row(std::size_t r) const {
    return change.subspan(row_offset[r], row_offset[r + 1] - row_offset[r]);
  }
  std::span<const std::uint32_t> row(std::uint32_t y, std::uint32_t z) const { return row(y + std::size_t{ny} * z); }

  /// One slice, which does not repeat along z.
  VoxelView slice(std::uint32_t z) const {
    return {nx,    ny, 1, edge, {periodic[0], periodic[1], false}, row_offset.subspan(std::size_t{ny} * z, ny + std::size_t{1}),
            change};
  }
};

/// Owned runs of a box; 4 bytes a row and 8 bytes a run.
struct VoxelStack {
  std::uint32_t nx = 0, ny = 0, nz = 0;
  std::array<Nm, 3> edge{1, 1, 1};
  std::array<bool, 3> periodic{};
  Buffer<std::uint32_t> row_offset{0};
  Buffer<std::uint32_t> change;

  VoxelStack() = default;
  VoxelStack(std::uint32_t columns, std::uint32_t rows, std::array<Nm, 3> edges, std::array<bool, 3> repeats = {})
      : nx(columns), ny(rows), edge(edges), periodic(repeats) {}

  /// Puts a slice on top of those before; nx columns and ny rows.
  /// false  the box has 2^32 changes or more, which runs cannot hold; nothing is added
  bool append(const RunsView& slice) {
    const std::uint64_t before = change.size(), first = slice.row_offset.front(), last = slice.row_offset.back();
    if (before + (last - first) > UINT32_MAX) return false;
    change.insert(change.end(), slice.change.begin() + static_cast<std::ptrdiff_t>(first),
                  slice.change.begin() + static_cast<std::ptrdiff_t>(last));
    for (std::uint32_t r = 1; r <= ny; ++r) {
      row_offset.push_back(static_cast<std::uint32_t>(before + slice.row_offset[r] - first));
    }
    ++nz;
    return true;
  }

  VoxelView view() const { return {nx, ny, nz, edge, periodic, row_offset, change}; }
  operator VoxelView() const { return view(); }
};

/// Number of set voxels. cost  O(runs)
inline std::uint64_t set_voxels(const VoxelView& box) {
  std::uint64_t set = 0;
  if (box.row_offset.empty()) return set;
  for (std::size_t i = box.row_offset.front(); i + 1 < box.row_offset.back(); i += 2) set += box.change[i + 1] - box.change[i];
  return set;
}

// --- a number for each voxel of one plane of a box.

/// value  row by row: columns along the first axis but the normal, rows along the second, in the order x, y, z
struct Plane {
  int normal = 2;        // axis
  std::uint32_t at = 0;  // voxel along it
  std::uint32_t columns = 0, rows = 0;
  Buffer<float> value;
};

/// The two axes of a plane, in the order x, y, z.
constexpr int column_axis(int normal) { return normal == 0 ? 1 : 0; }
constexpr int row_axis(int normal) { return normal == 2 ? 1 : 2; }

}  // namespace lamina
