#include "stages/stokes/cells.h"

#include <algorithm>
#include <utility>

#include "stages/stokes/sums.h"
#include "stages/stokes/walls.h"

namespace lamina::stokes {
namespace {

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
struct Stretches {
  struct Stretch {
    std::uint32_t begin, end, first;
  };
  Buffer<std::uint32_t> row_begin{0};
  Buffer<Stretch> stretch;

  explicit Stretches(const VoxelView& solid) {
    std::uint32_t cells = 0;
    for_each_void(solid, [&](std::size_t r, std::uint32_t begin, std::uint32_t end) {
      while (row_begin.size() <= r) row_begin.push_back(static_cast<std::uint32_t>(stretch.size()));
      stretch.push_back({begin, end, cells});
      cells += end - begin;
    });
    while (row_begin.size() <= solid.rows()) row_begin.push_back(static_cast<std::uint32_t>(stretch.size()));
    row_begin.front() = 0;
  }
  std::span<const Stretch> row(std::size_t r) const { return {stretch.data() + row_begin[r], row_begin[r + 1] - row_begin[r]}; }
};

/// Joins each cell of one row with the one of another row that has the same x, which lies above it along an axis.
void join_rows(std::span<const Stretches::Stretch> lower, std::span<const Stretches::Stretch> upper, int axis, Cells& cells) {
  std::size_t u = 0;
  for (const auto& [begin, end, first] : lower) {
    while (u < upper.size() && upper[u].end <= begin) ++u;
    for (std::size_t v = u; v < upper.size() && upper[v].begin < end; ++v) {
      for (std::uint32_t x = std::max(begin, upper[v].begin); x < std::min(end, upper[v].end); ++x) {
        const std::uint32_t below = first + (x - begin), above = upper[v].first + (x - upper[v].begin);
        cells.neighbour[below][2 * axis + 1] = above;
        cells.neighbour[above][2 * axis] = below;
      }
    }
  }
}

void join_along_x(std::span<const Stretches::Stretch> row, std::uint32_t nx, bool periodic, Cells& cells) {
  for (const auto& [begin, end, first] : row) {
    for (std::uint32_t i = first; i + 1 < first + (end - begin); ++i) {
      cells.neighbour[i][1] = i + 1;
      cells.neighbour[i + 1][0] = i;
    }
  }
  if (!periodic || row.empty() || row.front().begin != 0 || row.back().end != nx) return;
  const std::uint32_t last = row.back().first + (row.back().end - row.back().begin) - 1;
  cells.neighbour[last][1] = row.front().first;
  cells.neighbour[row.front().first][0] = last;
}

void join(const VoxelView& solid, const Stretches& stretches, Cells& cells) {
  for (std::uint32_t z = 0; z < solid.nz; ++z) {
    for (std::uint32_t y = 0; y < solid.ny; ++y) {
      const auto row_at = [&](std::uint32_t at_y, std::uint32_t at_z) {
        return stretches.row(at_y % solid.ny + std::size_t{solid.ny} * (at_z % solid.nz));
      };
      const auto row = row_at(y, z);
      join_along_x(row, solid.nx, solid.periodic[0], cells);
      if (y + 1 < solid.ny || solid.periodic[1]) join_rows(row, row_at(y + 1, z), 1, cells);
      if (z + 1 < solid.nz || solid.periodic[2]) join_rows(row, row_at(y, z + 1), 2, cells);
    }
  }
}

Buffer<Place> places_of(const VoxelView& solid) {
  Buffer<Place> places;
  for_each_void(solid, [&](std::size_t r, std::uint32_t begin, std::uint32_t end) {
    const auto y = static_cast<std::uint32_t>(r % solid.ny), z = static_cast<std::uint32_t>(r / solid.ny);
    for (std::uint32_t x = begin; x < end; ++x) places.push_back({x, y, z});
  });
  return places;
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

void hold_by(const Walls& walls, const Buffer<Place>& places, Cells& cells) {
  std::array<double, 3> weight{};
  for (std::size_t a = 0; a < 3; ++a) weight[a] = 1 / (cells.edge[a] * cells.edge[a]);
  for_pieces(cells.size(), [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) {
      cells.hold[i] = Cells::Hold{};
      for (int a = 0; a < 3; ++a)
        cells.hold[i][a] = walls.open(places[i], a)
                               ? static_cast<std::uint16_t>(walls.hold(places[i], a, weight) / Cells::kHold + 0.5)
                               : Cells::kShut;
    }
  });
}

/// Groups what lies in `box`; places and box become those of the groups, which count as their first members do.
Groups group(Buffer<Place>& places, std::array<std::uint32_t, 3>& box) {
  std::array<std::uint32_t, 3> half{};
  for (std::size_t a = 0; a < 3; ++a) half[a] = (box[a] + 1) / 2;
  constexpr std::uint32_t kNone = UINT32_MAX;
  Buffer<std::uint32_t> number(std::size_t{half[0]} * half[1] * half[2]), of(places.size());
  std::fill(number.begin(), number.end(), kNone);
  Groups groups;
  Buffer<Place> grouped;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Place at = {places[i][0] / 2, places[i][1] / 2, places[i][2] / 2};
    std::uint32_t& here = number[at[0] + half[0] * (at[1] + std::size_t{half[1]} * at[2])];
    if (here == kNone) {
      here = static_cast<std::uint32_t>(grouped.size());
      grouped.push_back(at);
      groups.begin.push_back(0);
    }
    of[i] = here;
    ++groups.begin[here + 1];
  }
  for (std::size_t g = 1; g < groups.begin.size(); ++g) groups.begin[g] += groups.begin[g - 1];
  groups.member.resize(places.size());
  Buffer<std::uint32_t> next = groups.begin;
  for (std::size_t i = 0; i < places.size(); ++i) groups.member[next[of[i]]++] = static_cast<std::uint32_t>(i);
  places = std::move(grouped);
  box = half;
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
  join(solid, Stretches(solid), cells);
  Buffer<Place> places = places_of(solid);
  hold_by(walls, places, cells);
  std::array<std::uint32_t, 3> box = cells.box;
  while (grid.levels.size() < levels && places.size() > 512) grid.levels.push_back(group(places, box));
  return grid;
}

}  // namespace lamina::stokes
