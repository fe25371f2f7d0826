#include "stages/stokes/cells.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <utility>

#include "stages/stokes/sums.h"
#include "stages/stokes/walls.h"

namespace lamina::stokes {
namespace {

constexpr double kMinYield = 0.2;

/// Calls visit(row, begin, end) for all stretches of void.
template <class Visit>
void for_each_void(const VoxelView& solid, const Visit& visit) {
  for (std::size_t r = 0; r < solid.rows(); ++r) {
    std::uint32_t begin = 0;
    const auto changes = solid.row(r);
    for (std::size_t i = 0; i < changes.size(); i += 2) {
      if (changes[i] > begin) visit(r, begin, changes[i]);
      begin = changes[i + 1];
    }
    if (begin < solid.nx) visit(r, begin, solid.nx);
  }
}

/// Stretches of void of all rows, each with the number of its first cell.
struct CoveredSpans {
  struct CellSpan {
    std::uint32_t begin, end, first;
  };
  Buffer<std::uint32_t> row_begin{0};
  Buffer<CellSpan> span;

  explicit CoveredSpans(const VoxelView& solid) {
    std::uint32_t cells = 0;
    for_each_void(solid, [&](std::size_t r, std::uint32_t begin, std::uint32_t end) {
      while (row_begin.size() <= r) row_begin.push_back(static_cast<std::uint32_t>(span.size()));
      span.push_back({begin, end, cells});
      cells += end - begin;
    });
    while (row_begin.size() <= solid.rows()) row_begin.push_back(static_cast<std::uint32_t>(span.size()));
    row_begin.front() = 0;
  }
  std::span<const CellSpan> row(std::size_t r) const { return {span.data() + row_begin[r], row_begin[r + 1] - row_begin[r]}; }
};

/// Joins each cell of one row with the one of another row that has the same x, which lies above it along an axis.
void join_rows(std::span<const CoveredSpans::CellSpan> lower, std::span<const CoveredSpans::CellSpan> upper, int axis,
               const Buffer<std::uint32_t>& number, Cells& cells) {
  std::size_t u = 0;
  for (const auto& [begin, end, first] : lower) {
    while (u < upper.size() && upper[u].end <= begin) ++u;
    for (std::size_t v = u; v < upper.size() && upper[v].begin < end; ++v) {
      for (std::uint32_t x = std::max(begin, upper[v].begin); x < std::min(end, upper[v].end); ++x) {
        const std::uint32_t below = number[first + (x - begin)], above = number[upper[v].first + (x - upper[v].begin)];
        cells.neighbour[below][2 * axis + 1] = above;
        cells.neighbour[above][2 * axis] = below;
      }
    }
  }
}

void join_along_x(std::span<const CoveredSpans::CellSpan> row, std::uint32_t nx, bool periodic,
                  const Buffer<std::uint32_t>& number, Cells& cells) {
  for (const auto& [begin, end, first] : row) {
    for (std::uint32_t i = first; i + 1 < first + (end - begin); ++i) {
      cells.neighbour[number[i]][1] = number[i + 1];
      cells.neighbour[number[i + 1]][0] = number[i];
    }
  }
  if (!periodic || row.empty() || row.front().begin != 0 || row.back().end != nx) return;
  const std::uint32_t first = number[row.front().first];
  const std::uint32_t last = number[row.back().first + (row.back().end - row.back().begin) - 1];
  cells.neighbour[last][1] = first;
  cells.neighbour[first][0] = last;
}

/// number  of the cells that stretches count row by row
void join(const VoxelView& solid, const CoveredSpans& intervals, const Buffer<std::uint32_t>& number, Cells& cells) {
  for (std::uint32_t z = 0; z < solid.nz; ++z) {
    for (std::uint32_t y = 0; y < solid.ny; ++y) {
      const auto row_at = [&](std::uint32_t at_y, std::uint32_t at_z) {
        return intervals.row(at_y % solid.ny + std::size_t{solid.ny} * (at_z % solid.nz));
      };
      const auto row = row_at(y, z);
      join_along_x(row, solid.nx, solid.periodic[0], number, cells);
      if (y + 1 < solid.ny || solid.periodic[1]) join_rows(row, row_at(y + 1, z), 1, number, cells);
      if (z + 1 < solid.nz || solid.periodic[2]) join_rows(row, row_at(y, z + 1), 2, number, cells);
    }
  }
}

/// Every third bit of a number, and back.
std::uint64_t spread(std::uint64_t x) {
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}
std::uint32_t gathered(std::uint64_t x) {
  x &= 0x1249249249249249;
  x = (x | x >> 2) & 0x10c30c30c30c30c3;
  x = (x | x >> 4) & 0x100f00f00f00f00f;
  x = (x | x >> 8) & 0x1f0000ff0000ff;
  x = (x | x >> 16) & 0x1f00000000ffff;
  return static_cast<std::uint32_t>(x | x >> 32);
}

/// A cell's place in Morton's order, and its number row by row.
struct Placed {
  std::uint64_t key;
  std::uint32_t row_by_row;
  CellIndex position() const { return {gathered(key), gathered(key >> 1), gathered(key >> 2)}; }
};
Buffer<Placed> in_order(const VoxelView& solid) {
  Buffer<Placed> cells;
  cells.reserve(solid.voxels() - set_voxels(solid));
  for_each_void(solid, [&](std::size_t r, std::uint32_t begin, std::uint32_t end) {
    const std::uint64_t yz = spread(r % solid.ny) << 1 | spread(r / solid.ny) << 2;
    for (std::uint32_t x = begin; x < end; ++x) cells.push_back({spread(x) | yz, static_cast<std::uint32_t>(cells.size())});
  });
  tbb::parallel_sort(cells.begin(), cells.end(), [](const Placed& a, const Placed& b) { return a.key < b.key; });
  return cells;
}

/// Voxels without an open face.
VoxelStack where_nothing_passes(const Walls& walls, const VoxelView& fine) {
  const auto [nx, ny, nz] = walls.size();
  VoxelStack solid(nx, ny, fine.edge, fine.periodic);
  Runs slice;
  slice.columns = nx;
  for (std::uint32_t z = 0; z < nz; ++z) {
    slice.row_offset.assign(1, 0);
    slice.change.clear();
    for (std::uint32_t y = 0; y < ny; ++y) {
      bool before = false;
      for (std::uint32_t x = 0; x < nx; ++x) {
        const bool closed = !walls.passes({x, y, z});
        if (closed != before) slice.change.push_back(x);
        before = closed;
      }
      if (before) slice.change.push_back(nx);
      slice.row_offset.push_back(static_cast<std::uint32_t>(slice.change.size()));
    }
    solid.append(slice);
  }
  return solid;
}

void hold_by(const Walls& walls, const Buffer<Placed>& order, Cells& cells) {
  std::array<double, 3> weight{};
  for (std::size_t a = 0; a < 3; ++a) weight[a] = 1 / (cells.edge[a] * cells.edge[a]);
  for_pieces(cells.size(), [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) {
      cells.hold[i] = Cells::Hold{};
      const CellIndex at = order[i].position();
      for (int a = 0; a < 3; ++a)
        cells.hold[i][a] =
            walls.open(at, a) ? static_cast<std::uint16_t>(walls.hold(at, a, weight) / Cells::kHold + 0.5) : Cells::kShut;
    }
  });
}

/// A cell whose faces walls hold lets out little.
void yield_by(Cells& cells) {
  std::array<double, 3> weight{};
  double around = 0;
  for (std::size_t a = 0; a < 3; ++a) around += 2 * (weight[a] = 1 / (cells.edge[a] * cells.edge[a]));
  const auto through = [&](std::uint32_t i, int a) {
    const std::uint16_t hold = cells.hold[i][a];
    return hold == Cells::kShut ? 0.0 : weight[static_cast<std::size_t>(a)] / (around + double{Cells::kHold} * hold);
  };
  for_pieces(cells.size(), [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) {
      double sum = 0;
      for (int a = 0; a < 3; ++a) {
        const std::uint32_t below = cells.neighbour[i][static_cast<std::size_t>(2 * a)];
        sum += through(i, a) + (below == cells.size() ? 0 : through(below, a));
      }
      cells.hold[i][3] = static_cast<std::uint16_t>(std::max(kMinYield, sum) / Cells::kHold + 0.5);
    }
  });
}

/// Blocks of what has these keys, which become those of the blocks.
Groups group(Buffer<std::uint64_t>& keys) {
  Groups groups;
  std::size_t blocks = 0;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::uint64_t key = keys[i] >> 3;
    if (i > 0 && key == keys[blocks - 1]) continue;
    groups.begin.push_back(static_cast<std::uint32_t>(i));
    keys[blocks++] = key;
  }
  groups.begin.push_back(static_cast<std::uint32_t>(keys.size()));
  keys.resize(blocks);
  return groups;
}

}  // namespace

Result<Grid> make_grid(const VoxelView& fine, std::uint32_t factor, std::uint32_t levels) {
  for (const std::uint32_t side : fine.size())
    if (factor % 2 == 0 || side % factor != 0)
      return Error{Fault::kInput, "voxels of the flow are an odd number of the solid's wide, and fill the box"};
  const Walls walls(fine, factor);
  const VoxelStack solid = where_nothing_passes(walls, fine);
  const std::uint64_t count = solid.view().voxels() - set_voxels(solid);
  if (count == 0) return Error{Fault::kInput, "there is no void for a fluid"};
  if (count >= std::uint64_t{1} << 31)
    return Error{Fault::kInput, "more void than 2^31 voxels; take a smaller window or larger voxels"};
  Grid grid;
  Cells& cells = grid.cells;
  cells.box = walls.size();
  const Nm shortest = std::min({fine.edge[0], fine.edge[1], fine.edge[2]});
  for (std::size_t a = 0; a < 3; ++a) cells.edge[a] = static_cast<double>(fine.edge[a]) / shortest;
  cells.unit_m = shortest * 1e-9 * factor;
  cells.hold.resize(count);
  cells.neighbour.resize(count);
  const auto none = static_cast<std::uint32_t>(count);
  std::fill(cells.neighbour.begin(), cells.neighbour.end(), std::array{none, none, none, none, none, none});
  Buffer<std::uint64_t> keys(count);
  {
    const Buffer<Placed> order = in_order(solid);
    Buffer<std::uint32_t> number(count);
    for (std::uint32_t i = 0; i < none; ++i) number[order[i].row_by_row] = i;
    join(solid, CoveredSpans(solid), number, cells);
    hold_by(walls, order, cells);
    yield_by(cells);
    for (std::uint32_t i = 0; i < none; ++i) keys[i] = order[i].key;
  }
  while (grid.levels.size() < levels && keys.size() > 512) grid.levels.push_back(group(keys));
  return grid;
}

Buffer<std::array<std::uint32_t, 3>> cell_positions(const VoxelView& fine, std::uint32_t factor) {
  const Buffer<Placed> order = in_order(where_nothing_passes(Walls(fine, factor), fine));
  Buffer<CellIndex> positions(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) positions[i] = order[i].position();
  return positions;
}

}  // namespace lamina::stokes
