// stages/pores/rows.h: boxes of voxels row by row: what is void, what two have in common, fewer and larger voxels.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>

#include "stages/data/buffer.h"
#include "stages/data/voxels.h"

namespace lamina::pores {

using Row = std::span<const std::uint32_t>;

/// Set in one of them or both; in both; in the first but not in the second.
enum class Operation : std::uint8_t { kUnion, kIntersection, kDifference };

/// Calls take(column) where the result changes, in order. cost  O(changes)
template <class Take>
void combine_rows(Row a, Row b, Operation operation, const Take& take) {
  const auto wanted = [operation](std::size_t in_a, std::size_t in_b) {
    if (operation == Operation::kUnion) return (in_a | in_b) != 0;
    return operation == Operation::kIntersection ? (in_a & in_b) != 0 : in_a > in_b;
  };
  for (std::size_t i = 0, j = 0; i < a.size() || j < b.size();) {
    const bool before = wanted(i & 1, j & 1);
    const std::uint32_t column = j == b.size() || (i < a.size() && a[i] < b[j]) ? a[i] : b[j];
    if (i < a.size() && a[i] == column) ++i;
    if (j < b.size() && b[j] == column) ++j;
    if (wanted(i & 1, j & 1) != before) take(column);
  }
}

/// Calls take(i, j) for each run i of a and j of b that have a column in common. cost  O(runs)
template <class Take>
void for_each_overlap(Row a, Row b, const Take& take) {
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (std::max(a[i], b[j]) < std::min(a[i + 1], b[j + 1])) take(i / 2, j / 2);
    (a[i + 1] <= b[j + 1] ? i : j) += 2;
  }
}

/// Makes a box row by row, by two calls of row(r, take) each, which calls take(change): the first counts them. Parallel.
/// throws  std::length_error  2^32 changes or more
template <class MakeRow>
void make_rows(const VoxelView& like, VoxelStack& out, const MakeRow& row) {
  out.nx = like.nx, out.ny = like.ny, out.nz = like.nz;
  out.edge = like.edge, out.periodic = like.periodic;
  out.row_offset.resize(like.rows() + 1);
  out.row_offset[0] = 0;
  tbb::parallel_for(std::uint32_t{0}, like.nz, [&](std::uint32_t z) {
    for (std::size_t r = std::size_t{like.ny} * z, end = r + like.ny; r < end; ++r) {
      std::uint32_t count = 0;
      row(r, [&](std::uint32_t) { ++count; });
      out.row_offset[r + 1] = count;
    }
  });
  std::uint64_t sum = 0;
  for (std::uint32_t& offset : out.row_offset) {
    sum += offset;
    if (sum > UINT32_MAX) throw std::length_error("a box of voxels has 2^32 changes or more");
    offset = static_cast<std::uint32_t>(sum);
  }
  out.change.resize(sum);
  tbb::parallel_for(std::uint32_t{0}, like.nz, [&](std::uint32_t z) {
    for (std::size_t r = std::size_t{like.ny} * z, end = r + like.ny; r < end; ++r) {
      std::uint32_t* next = out.change.data() + out.row_offset[r];
      row(r, [&](std::uint32_t column) { *next++ = column; });
    }
  });
}

// --- what a solid leaves empty, as runs.

/// The voxels that are not set: of the body, or of the whole box without one.
/// body    of the size of the solid; its edges and periodic axes do not count
/// throws  std::length_error  2^32 changes or more
/// cost    O(runs + rows), parallel over slices
VoxelStack void_of(const VoxelView& solid, const VoxelView* body = nullptr);

/// The voxels that are set in both, or in the first but not in the second.
VoxelStack both_of(const VoxelView& one, const VoxelView& other);
VoxelStack without(const VoxelView& one, const VoxelView& other);

// --- the same box in fewer, larger voxels.

/// Adds `sign` for each set voxel of a row from `offset` on to blocks of `side` voxels along x.
void add_to_blocks(Row row, std::uint32_t offset, std::uint32_t columns, std::int32_t sign, std::uint32_t side,
                   std::span<std::int32_t> blocks);

/// Merges blocks of factor[0] x factor[1] x factor[2] voxels: one is set if more than half of its voxels are. Where it is just
/// half of them, the block is as its first voxel is, the lowest along x, y and z, so that neither side grows.
/// factor  at least 1 each; voxels beyond the last whole block are left out
/// cost    O(runs + rows + voxels of the result), one thread
VoxelStack coarser(const VoxelView& box, const std::array<std::uint32_t, 3>& factor);

}  // namespace lamina::pores
