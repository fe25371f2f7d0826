#include "stages/pores/porosity.h"

#include <tbb/parallel_for.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "stages/pores/rows.h"

namespace lamina::pores {
Porosity porosity(const VoxelView& solid, const VoxelView* body, Faces outside) {
  Porosity result;
  const VoxelStack empty = void_of(solid, body);
  const Parts parts = parts_of(empty);
  Buffer<std::uint8_t> open(parts.size(), std::uint8_t{0});
  if (body != nullptr) open = adjacent_parts(empty, parts, without(void_of(solid), *body));
  result.body = body == nullptr ? solid.voxels() : set_voxels(*body);
  result.voxel_mm3 = mm(solid.edge[0]) * mm(solid.edge[1]) * mm(solid.edge[2]);
  result.parts = static_cast<std::uint32_t>(parts.size());
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const bool is_open = open[p] != 0 || parts.is_reached(p, outside);
    for (int axis = 0; axis < 3; ++axis)
      if (parts.through(p, axis)) result.through[static_cast<std::size_t>(axis)] += parts.voxels[p];
    result.empty += parts.voxels[p];
    if (is_open) result.open += parts.voxels[p];
    if (!is_open) ++result.cavities;
  }
  return result;
}

VoxelStack void_through(const VoxelView& solid, int axis) {
  const VoxelStack empty = void_of(solid);
  const Parts parts = parts_of(empty);
  VoxelStack result;
  make_rows(empty, result, [&](std::size_t r, const auto& take) {
    for (std::uint32_t i = empty.row_offset[r]; i < empty.row_offset[r + 1]; i += 2) {
      if (!parts.through(parts.part_of(i / 2), axis)) continue;
      take(empty.change[i]);
      take(empty.change[i + 1]);
    }
  });
  return result;
}

namespace {

using Cell = std::array<std::int32_t, 3>;  // of the lattice of boxes

Cell sum(const Cell& a, const Cell& b, std::int32_t sign) {
  return {a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2]};
}

/// Parts that are joined to groups; each part knows its box relative to its group.
class Groups {
 public:
  explicit Groups(const Parts& parts) : wraps_(parts.wraps), faces_(parts.faces), up_(parts.size()), cell_(parts.size()) {
    for (std::uint32_t p = 0; p < up_.size(); ++p) up_[p] = p;
  }

  /// The group of a part, and the part's box there.
  std::pair<std::uint32_t, Cell> find(std::uint32_t part) {
    std::uint32_t root = part;
    Cell cell{};
    for (; up_[root] != root; root = up_[root]) cell = sum(cell, cell_[root], 1);
    Cell left = cell;
    while (up_[part] != root && part != root) {
      const Cell own = std::exchange(cell_[part], left);
      left = sum(left, own, -1);
      part = std::exchange(up_[part], root);
    }
    return {root, cell};
  }

  /// b is in the box that is `shift` from that of a.
  void join(std::uint32_t a, std::uint32_t b, const Cell& shift) {
    const auto [to, cell_a] = find(a);
    const auto [from, cell_b] = find(b);
    const Cell between = sum(sum(cell_a, shift, 1), cell_b, -1);
    if (to == from) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        if (between[axis] != 0) wraps_[to] = static_cast<std::uint8_t>(wraps_[to] | 1u << axis);
      return;
    }
    up_[from] = to;
    cell_[from] = between;
    wraps_[to] = static_cast<std::uint8_t>(wraps_[to] | wraps_[from]);
    faces_[to] = static_cast<Faces>(faces_[to] | faces_[from]);
  }

  bool is_reached(std::uint32_t part, Faces outside) {
    const std::uint32_t root = find(part).first;
    return reached(faces_[root], wraps_[root], outside);
  }

 private:
  Buffer<std::uint8_t> wraps_;
  Buffer<Faces> faces_;
  Buffer<std::uint32_t> up_;
  Buffer<Cell> cell_;  // relative to up_
};

/// Joins parts of the void that lie above each other, with no more than so many solid voxels between.
void join_over_contacts(const VoxelView& empty, const Parts& parts, std::uint32_t contact, Groups& groups) {
  for (std::uint32_t z = 0; z < empty.nz; ++z) {
    for (std::uint32_t up = 2; up <= contact + 1; ++up) {
      const std::uint32_t above = (z + up) % empty.nz;
      const auto boxes = static_cast<std::int32_t>((z + up) / empty.nz);
      if (boxes > 0 && !empty.periodic[2]) break;
      for (std::uint32_t y = 0; y < empty.ny; ++y) {
        const std::size_t r = y + std::size_t{empty.ny} * z, s = y + std::size_t{empty.ny} * above;
        for_each_overlap(empty.row(r), empty.row(s), [&](std::size_t i, std::size_t j) {
          const std::uint32_t a = parts.piece[empty.row_offset[r] / 2 + i], b = parts.piece[empty.row_offset[s] / 2 + j];
          // Cells of pieces are relative to their part.
          const Cell shift = sum(sum({0, 0, boxes}, parts.cell[b], -1), parts.cell[a], 1);
          groups.join(parts.part[a], parts.part[b], shift);
        });
      }
    }
  }
}

/// The nearest whole number of voxels.
Nm whole_gap(Nm gap, Nm edge) { return (gap + edge / 2) / edge * edge; }

}  // namespace

VoxelStack bond(const VoxelView& solid, Nm gap) {
  const VoxelStack along_x = close_gaps(solid, 0, whole_gap(gap, solid.edge[0]));
  return close_gaps(along_x, 1, whole_gap(gap, solid.edge[1]));
}

Connected connected(const VoxelView& solid, Nm gap, Nm contact, Faces outside) {
  Connected result;
  result.voxels = solid.voxels();
  const VoxelStack between = void_of(bond(solid, gap));
  const Parts tight = parts_of(between);
  for (std::size_t p = 0; p < tight.size(); ++p)
    if (tight.is_reached(p, outside)) result.bonded += tight.voxels[p];

  const VoxelStack empty = void_of(solid);
  const Parts parts = parts_of(empty);
  Groups groups(parts);
  join_over_contacts(empty, parts, static_cast<std::uint32_t>(contact / solid.edge[2]), groups);
  for (std::uint32_t p = 0; p < parts.size(); ++p)
    if (groups.is_reached(p, outside)) result.unbonded += parts.voxels[p];
  return result;
}

namespace {

/// Rows of one slice, and those beyond its ends.
struct SliceRows {
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
SliceRows joined(const SliceRows& rows, std::size_t step, Operation operation) {
  SliceRows out;
  for (std::size_t r = 0; r + step < rows.size(); ++r) {
    combine_rows(rows[r], rows[r + step], operation, [&](std::uint32_t column) { out.change.push_back(column); });
    out.end_row();
  }
  return out;
}

/// The same of `length` rows from each on, from windows of half the length and a rest that overlaps.
SliceRows windows(SliceRows rows, std::size_t length, Operation operation) {
  std::size_t have = 1;
  while (have < length) {
    const std::size_t step = std::min(have, length - have);
    rows = joined(rows, step, operation);
    have += step;
  }
  return rows;
}

/// Gaps of up to `gap` rows are filled: rows are spread over `gap` more, and of these windows what is common is kept.
SliceRows closed_along_y(const VoxelView& slice, std::uint32_t gap) {
  SliceRows rows;
  const std::int64_t ny = slice.ny, far = gap;
  for (std::int64_t y = -far; y < ny + far; ++y) {
    const bool inside = y >= 0 && y < ny;
    rows.add(inside || slice.periodic[1] ? slice.row(static_cast<std::uint32_t>(((y % ny) + ny) % ny), 0) : Row());
  }
  rows = windows(std::move(rows), std::size_t{gap} + 1, Operation::kUnion);
  return windows(std::move(rows), std::size_t{gap} + 1, Operation::kIntersection);
}

/// The row with runs joined whose gap is small; across the ends too if it repeats.
void close_row(Row row, std::uint32_t nx, bool periodic, std::uint32_t gap, SliceRows& out) {
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
  const std::uint32_t maximum = std::min(voxels, solid.size()[a]);
  std::vector<SliceRows> slices(solid.nz);
  tbb::parallel_for(std::uint32_t{0}, solid.nz, [&](std::uint32_t z) {
    const VoxelView slice = solid.slice(z);
    if (axis == 1 && solid.ny > 0) slices[z] = closed_along_y(slice, maximum);
    for (std::uint32_t y = 0; axis == 0 && y < solid.ny; ++y) {
      close_row(slice.row(y, 0), solid.nx, solid.periodic[0], maximum, slices[z]);
    }
  });
  VoxelStack out(solid.nx, solid.ny, solid.edge, solid.periodic);
  for (SliceRows& slice : slices) {
    if (!out.append(RunsView{solid.nx, slice.offset, slice.change})) {
      throw std::length_error("a box of voxels has 2^32 changes or more");
    }
    slice = {};
  }
  return out;
}

}  // namespace lamina::pores
