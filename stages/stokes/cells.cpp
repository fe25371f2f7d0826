#include "stages/stokes/cells.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <utility>

namespace lamina::stokes {
namespace {

constexpr double kMinYield = 0.2;
constexpr double kNearest = 0.1;  // voxels: nearer walls count as that near

std::array<std::int64_t, 3> moved(std::array<std::int64_t, 3> at, int axis, int by) {
  at[static_cast<std::size_t>(axis)] += by;
  return at;
}

/// Sets bits begin .. end - 1 of a row.
void set_bits(std::uint64_t* row, std::uint32_t begin, std::uint32_t end) {
  while (begin < end) {
    const std::uint32_t bit = begin % 64, count = std::min(end - begin, 64 - bit);
    row[begin / 64] |= (count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1) << bit;
    begin += count;
  }
}

/// The upper faces of voxels that are `factor` fine ones wide. A face is open if its middle is in the void: neither of the two
/// fine voxels that touch there is solid. Where solid parts the two open faces of a voxel, thinner than it, both are shut.
/// cost  a bit a fine voxel and a byte a voxel
class Walls {
 public:
  /// fine    sides are multiples of factor
  /// factor  odd, so that middles of voxels are middles of fine ones
  Walls(const VoxelView& fine, std::uint32_t factor);

  std::array<std::uint32_t, 3> size() const { return size_; }
  bool open(const CellIndex& at, int axis) const { return (open_[index(at)] >> axis & 1) != 0; }
  /// Whether any of a voxel's six faces is open.
  bool passes(const CellIndex& at) const;
  /// How much more walls hold the velocity through an open face than its neighbours would: the sum of
  /// weight x (1 / distance - 1) of the sides where the next face of its kind is not open.
  double hold(const CellIndex& at, int face, const std::array<double, 3>& weight) const;

 private:
  template <class Visit>
  void for_each_voxel(const Visit& visit) const;
  std::array<std::int64_t, 3> below_face(const CellIndex& at, int face) const;
  bool film_within(const CellIndex& at, int axis, const CellIndex& below) const;
  double distance(const CellIndex& at, int face, int along, bool up) const;
  std::size_t index(const CellIndex& at) const {
    return at[0] + std::size_t{size_[0]} * (at[1] + std::size_t{size_[1]} * at[2]);
  }
  bool solid(std::array<std::int64_t, 3> at) const;
  bool step(CellIndex& at, int axis, bool up) const;
  std::uint32_t voids(std::array<std::int64_t, 3> from, int along, bool up) const;

  std::array<std::uint32_t, 3> size_, fine_;
  std::array<bool, 3> periodic_;
  std::uint32_t factor_;
  std::size_t words_;           // of a fine row
  Buffer<std::uint64_t> bits_;  // of the fine solid
  Buffer<std::uint8_t> open_;   // of each voxel, a bit for each upper face
};

Walls::Walls(const VoxelView& fine, std::uint32_t factor)
    : size_{fine.nx / factor, fine.ny / factor, fine.nz / factor},
      fine_(fine.size()),
      periodic_(fine.periodic),
      factor_(factor),
      words_((fine.nx + 63) / 64),
      bits_(words_ * fine.rows()),
      open_(std::size_t{size_[0]} * size_[1] * size_[2]) {
  tbb::parallel_for(std::uint32_t{0}, fine.nz, [&](std::uint32_t z) {
    for (std::uint32_t y = 0; y < fine.ny; ++y) {
      std::uint64_t* row = bits_.data() + words_ * (y + std::size_t{fine.ny} * z);
      std::fill(row, row + words_, 0);
      const auto changes = fine.row(y, z);
      for (std::size_t i = 0; i < changes.size(); i += 2) set_bits(row, changes[i], changes[i + 1]);
    }
  });
  for_each_voxel([&](const CellIndex& at) {
    std::uint32_t mask = 0;
    for (int a = 0; a < 3; ++a) {
      const std::array<std::int64_t, 3> below = below_face(at, a);
      if (!solid(below) && !solid(moved(below, a, 1))) mask |= 1u << a;
    }
    open_[index(at)] = static_cast<std::uint8_t>(mask);
  });
  Buffer<std::uint8_t> tight(open_.size());
  for_each_voxel([&](const CellIndex& at) {
    tight[index(at)] = open_[index(at)];
    for (int a = 0; a < 3; ++a) {
      CellIndex below = at, above = at;
      const bool shut = open(at, a) && ((step(below, a, false) && film_within(at, a, below)) ||
                                        (step(above, a, true) && film_within(above, a, at)));
      if (shut) tight[index(at)] &= static_cast<std::uint8_t>(~(1u << a));
    }
  });
  open_ = std::move(tight);
}

template <class Visit>
void Walls::for_each_voxel(const Visit& visit) const {
  tbb::parallel_for(std::uint32_t{0}, size_[2], [&](std::uint32_t z) {
    for (std::uint32_t y = 0; y < size_[1]; ++y)
      for (std::uint32_t x = 0; x < size_[0]; ++x) visit(CellIndex{x, y, z});
  });
}

/// The fine voxel right below the middle of an upper face.
std::array<std::int64_t, 3> Walls::below_face(const CellIndex& at, int face) const {
  std::array<std::int64_t, 3> below{};
  for (std::size_t b = 0; b < 3; ++b)
    below[b] = std::int64_t{at[b]} * factor_ + (static_cast<int>(b) == face ? factor_ - 1 : factor_ / 2);
  return below;
}

/// Whether solid parts the open faces of a voxel along an axis. below  the voxel before it
bool Walls::film_within(const CellIndex& at, int axis, const CellIndex& below) const {
  return open(at, axis) && open(below, axis) && voids(below_face(at, axis), axis, false) < factor_;
}

bool Walls::passes(const CellIndex& at) const {
  if (open_[index(at)] != 0) return true;
  for (int a = 0; a < 3; ++a) {
    CellIndex below = at;
    if (step(below, a, false) && open(below, a)) return true;
  }
  return false;
}

/// What lies behind ends that do not repeat is solid.
bool Walls::solid(std::array<std::int64_t, 3> at) const {
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int64_t n = fine_[a];
    if (at[a] >= 0 && at[a] < n) continue;
    if (!periodic_[a]) return true;
    at[a] = ((at[a] % n) + n) % n;
  }
  const std::uint64_t word =
      bits_[words_ * static_cast<std::size_t>(at[1] + std::int64_t{fine_[1]} * at[2]) + static_cast<std::size_t>(at[0] / 64)];
  return (word >> (at[0] % 64) & 1) != 0;
}

/// To the next voxel. false  there is none
bool Walls::step(CellIndex& at, int axis, bool up) const {
  const auto a = static_cast<std::size_t>(axis);
  const bool leaves = up ? at[a] + 1 == size_[a] : at[a] == 0;
  if (leaves && !periodic_[a]) return false;
  at[a] = leaves ? (up ? 0 : size_[a] - 1) : (up ? at[a] + 1 : at[a] - 1);
  return true;
}

/// Fine voxels without solid, that one included, of those that matter.
std::uint32_t Walls::voids(std::array<std::int64_t, 3> from, int along, bool up) const {
  std::uint32_t count = 0;
  while (count <= 3 * factor_ && !solid(from)) {
    ++count;
    from = moved(from, along, up ? 1 : -1);
  }
  return count;
}

/// From the middle of an open face to a wall, in voxels, at most 1. Along the face it is the mean of what the fine voxels on
/// its two sides see.
double Walls::distance(const CellIndex& at, int face, int along, bool up) const {
  const std::array<std::int64_t, 3> below = below_face(at, face), above = moved(below, face, 1);
  if (along == face) return std::min(1.0, static_cast<double>(voids(up ? above : below, along, up)) / factor_);
  const auto detected = [&](const std::array<std::int64_t, 3>& from) {
    return (static_cast<double>(voids(from, along, up)) - 0.5) / factor_;
  };
  return std::min(1.0, 0.5 * (detected(below) + detected(above)));
}

double Walls::hold(const CellIndex& at, int face, const std::array<double, 3>& weight) const {
  double sum = 0;
  for (int along = 0; along < 3; ++along) {
    for (const bool up : {false, true}) {
      CellIndex next = at;
      if (step(next, along, up) && open(next, face)) continue;
      sum += weight[static_cast<std::size_t>(along)] * (1 / std::max(kNearest, distance(at, face, along, up)) - 1);
    }
  }
  return sum;
}

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
