#include "stages/pores/closing.h"

#include <tbb/parallel_for.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "stages/pores/rows.h"

namespace lamina::pores {
namespace {

/// Rows of one slice, and those beyond its ends.
struct Rows {
  Buffer<std::uint32_t> offset{0}, change;

  std::size_t size() const { return offset.size() - 1; }
  Row operator[](std::size_t r) const { return Row(change).subspan(offset[r], offset[r + 1] - offset[r]); }
  void add(Row row) {
    change.insert(change.end(), row.begin(), row.end());
    end_row();
  }
  void end_row() { offset.push_back(static_cast<std::uint32_t>(change.size())); }
};

/// Row r becomes the union, or what is common, of rows r and r + step.
Rows joined(const Rows& rows, std::size_t step, Operation operation) {
  Rows out;
  for (std::size_t r = 0; r + step < rows.size(); ++r) {
    combine_rows(rows[r], rows[r + step], operation, [&](std::uint32_t column) { out.change.push_back(column); });
    out.end_row();
  }
  return out;
}

/// The same of `length` rows from each on, from windows of half the length and a rest that overlaps.
Rows windows(Rows rows, std::size_t length, Operation operation) {
  std::size_t have = 1;
  while (have < length) {
    const std::size_t step = std::min(have, length - have);
    rows = joined(rows, step, operation);
    have += step;
  }
  return rows;
}

/// Gaps of up to `gap` rows are filled: rows are spread over `gap` more, and of these windows what is common is kept.
Rows closed_along_y(const VoxelView& slice, std::uint32_t gap) {
  Rows rows;
  const std::int64_t ny = slice.ny, far = gap;
  for (std::int64_t y = -far; y < ny + far; ++y) {
    const bool inside = y >= 0 && y < ny;
    rows.add(inside || slice.periodic[1] ? slice.row(static_cast<std::uint32_t>(((y % ny) + ny) % ny), 0) : Row());
  }
  rows = windows(std::move(rows), std::size_t{gap} + 1, Operation::kUnion);
  return windows(std::move(rows), std::size_t{gap} + 1, Operation::kIntersection);
}

/// The row with runs joined whose gap is small; across the ends too if it repeats.
void close_row(Row row, std::uint32_t nx, bool periodic, std::uint32_t gap, Rows& out) {
  const bool around = periodic && !row.empty() && row.front() + (nx - row.back()) <= gap;
  for (std::size_t i = 0; i < row.size(); i += 2) {
    const bool first = i == 0, last = i + 2 == row.size();
    if (first || row[i] - row[i - 1] > gap) out.change.push_back(first && around ? 0 : row[i]);
    if (last || row[i + 2] - row[i + 1] > gap) out.change.push_back(last && around ? nx : row[i + 1]);
  }
  out.end_row();
}

}  // namespace

VoxelStack close_gaps(const VoxelView& solid, int axis, Nm gap) {
  const auto a = static_cast<std::size_t>(axis);
  const auto voxels = static_cast<std::uint32_t>(std::max(gap, 0) / solid.edge[a]);
  // A gap as long as the axis is none.
  const std::uint32_t most = std::min(voxels, solid.size()[a]);
  std::vector<Rows> slices(solid.nz);
  tbb::parallel_for(std::uint32_t{0}, solid.nz, [&](std::uint32_t z) {
    const VoxelView slice = solid.slice(z);
    if (axis == 1 && solid.ny > 0) slices[z] = closed_along_y(slice, most);
    for (std::uint32_t y = 0; axis == 0 && y < solid.ny; ++y) {
      close_row(slice.row(y, 0), solid.nx, solid.periodic[0], most, slices[z]);
    }
  });
  VoxelStack out(solid.nx, solid.ny, solid.edge, solid.periodic);
  for (Rows& slice : slices) {
    if (!out.append(RunsView{solid.nx, slice.offset, slice.change})) {
      throw std::length_error("a box of voxels has 2^32 changes or more");
    }
    slice = {};
  }
  return out;
}

}  // namespace lamina::pores
