#include "stages/pores/parts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "stages/pores/rows.h"

namespace lamina::pores {
namespace {

/// Sets of runs. The smallest member stands for its set, whatever the order of the unions.
class Sets {
 public:
  explicit Sets(Buffer<std::uint32_t>& parent) : parent_(parent) {}

  std::uint32_t find(std::uint32_t a) {
    while (parent_[a] != a) a = parent_[a] = parent_[parent_[a]];
    return a;
  }
  void merge(std::uint32_t a, std::uint32_t b) {
    a = find(a), b = find(b);
    if (a != b) parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  Buffer<std::uint32_t>& parent_;
};

using Cell = std::array<std::int32_t, 3>;

/// Sets of pieces that know in which cell each lies, seen from the one that stands for its set.
class CellSets {
 public:
  explicit CellSets(std::size_t pieces) : parent_(pieces), cell_(pieces, Cell{}), wraps_(pieces, std::uint8_t{0}) {
    for (std::size_t i = 0; i < pieces; ++i) parent_[i] = static_cast<std::uint32_t>(i);
  }

  /// Afterwards the parent of a is the one that stands for its set, and the cell is seen from there.
  std::uint32_t find(std::uint32_t a) {
    path_.clear();
    while (parent_[a] != a) {
      path_.push_back(a);
      a = parent_[a];
    }
    // The one nearest to the top is right already.
    for (std::size_t i = path_.size(); i-- > 0;) {
      const std::uint32_t at = path_[i];
      if (parent_[at] == a) continue;
      add(cell_[at], cell_[parent_[at]], 1);
      parent_[at] = a;
    }
    return a;
  }
  /// Where a lies in some cell, b lies one further along the axis.
  void merge(std::uint32_t a, std::uint32_t b, int axis) {
    const std::uint32_t top_a = find(a), top_b = find(b);
    Cell miss = cell_[a];  // cell of b as a has it less cell of b as b has it
    ++miss[static_cast<std::size_t>(axis)];
    add(miss, cell_[b], -1);
    if (top_a == top_b) {
      for (std::size_t i = 0; i < 3; ++i) wraps_[top_a] |= static_cast<std::uint8_t>((miss[i] != 0) << i);
      return;
    }
    const std::uint32_t top = std::min(top_a, top_b), other = std::max(top_a, top_b);
    parent_[other] = top;
    cell_[other] = Cell{};
    add(cell_[other], miss, other == top_b ? 1 : -1);
    wraps_[top] |= wraps_[other];
  }
  const Cell& cell(std::uint32_t a) const { return cell_[a]; }
  std::uint8_t wraps(std::uint32_t top) const { return wraps_[top]; }

 private:
  static void add(Cell& to, const Cell& cell, std::int32_t times) {
    for (std::size_t i = 0; i < 3; ++i) to[i] += times * cell[i];
  }

  Buffer<std::uint32_t> parent_, path_;
  Buffer<Cell> cell_;
  Buffer<std::uint8_t> wraps_;
};

class Finder {
 public:
  Finder(const VoxelView& set, Parts& parts) : set_(set), parts_(parts) {}

  void run() {
    parts_.first_run = set_.row_offset.front() / 2;
    parts_.piece.resize(set_.row_offset.back() / 2 - parts_.first_run);
    for (std::size_t i = 0; i < parts_.piece.size(); ++i) parts_.piece[i] = static_cast<std::uint32_t>(i);
    join_runs();
    join_pieces(number_pieces());
    measure();
  }

 private:
  static constexpr std::uint32_t kTogether = 16;  // slices that one thread joins

  std::size_t row(std::uint32_t y, std::uint32_t z) const { return y + std::size_t{set_.ny} * z; }
  std::uint32_t first_of(std::size_t r) const { return set_.row_offset[r] / 2 - parts_.first_run; }

  void join_rows(std::size_t one, std::size_t other) {
    Sets sets(parts_.piece);
    const std::uint32_t a = first_of(one), b = first_of(other);
    for_each_overlap(set_.row(one), set_.row(other), [&](std::size_t i, std::size_t j) {
      sets.merge(a + static_cast<std::uint32_t>(i), b + static_cast<std::uint32_t>(j));
    });
  }
  void join_slices(std::uint32_t z) {
    for (std::uint32_t y = 0; y < set_.ny; ++y) join_rows(row(y, z), row(y, z + 1));
  }

  // Runs of different groups of slices meet only when all groups are done.
  void join_runs() {
    const std::uint32_t groups = (set_.nz + kTogether - 1) / kTogether;
    tbb::parallel_for(std::uint32_t{0}, groups, [&](std::uint32_t group) {
      const std::uint32_t first = group * kTogether, end = std::min(set_.nz, first + kTogether);
      for (std::uint32_t z = first; z < end; ++z) {
        for (std::uint32_t y = 1; y < set_.ny; ++y) join_rows(row(y - 1, z), row(y, z));
        if (z > first) join_slices(z - 1);
      }
    });
    for (std::uint32_t group = 1; group < groups; ++group) join_slices(group * kTogether - 1);
  }

  // The parent of a run is a smaller one, whose number is known by then.
  std::uint32_t number_pieces() {
    std::uint32_t pieces = 0;
    for (std::uint32_t i = 0; i < parts_.piece.size(); ++i) {
      std::uint32_t& piece = parts_.piece[i];
      piece = piece == i ? pieces++ : parts_.piece[piece];
    }
    return pieces;
  }

  void join_ends(CellSets& sets, std::size_t last, std::size_t first, int axis) {
    const std::uint32_t a = first_of(last), b = first_of(first);
    for_each_overlap(set_.row(last), set_.row(first),
                     [&](std::size_t i, std::size_t j) { sets.merge(parts_.piece[a + i], parts_.piece[b + j], axis); });
  }

  void join_pieces(std::uint32_t pieces) {
    CellSets sets(pieces);
    for (std::uint32_t z = 0; z < set_.nz; ++z) {
      if (set_.periodic[1] && set_.ny > 0) join_ends(sets, row(set_.ny - 1, z), row(0, z), 1);
      for (std::uint32_t y = 0; y < set_.ny && set_.periodic[0]; ++y) {
        const Row own = set_.row(y, z);
        if (own.empty() || own.front() != 0 || own.back() != set_.nx) continue;
        const std::uint32_t first = first_of(row(y, z));
        sets.merge(parts_.piece[first + own.size() / 2 - 1], parts_.piece[first], 0);
      }
    }
    for (std::uint32_t y = 0; y < set_.ny && set_.periodic[2] && set_.nz > 0; ++y) {
      join_ends(sets, row(y, set_.nz - 1), row(y, 0), 2);
    }
    parts_.part.resize(pieces);
    parts_.cell.resize(pieces);
    for (std::uint32_t i = 0; i < pieces; ++i) {
      const std::uint32_t top = sets.find(i);
      parts_.cell[i] = sets.cell(i);
      parts_.part[i] = top == i ? static_cast<std::uint32_t>(parts_.wraps.size()) : parts_.part[top];
      if (top == i) parts_.wraps.push_back(sets.wraps(top));
    }
  }

  void measure() {
    parts_.voxels.assign(parts_.wraps.size(), 0);
    parts_.faces.assign(parts_.wraps.size(), 0);
    std::uint32_t run = 0;
    for (std::uint32_t z = 0; z < set_.nz; ++z) {
      for (std::uint32_t y = 0; y < set_.ny; ++y) {
        const Faces common = static_cast<Faces>(ends(y, set_.ny, 1) | ends(z, set_.nz, 2));
        const Row own = set_.row(y, z);
        for (std::size_t i = 0; i < own.size(); i += 2, ++run) {
          const std::uint32_t part = parts_.part[parts_.piece[run]];
          parts_.voxels[part] += own[i + 1] - own[i];
          parts_.faces[part] |= static_cast<Faces>(common | ends(own[i], set_.nx, 0) | ends(own[i + 1] - 1, set_.nx, 0));
        }
      }
    }
  }
  int ends(std::uint32_t at, std::uint32_t count, int axis) const {
    return set_.periodic[static_cast<std::size_t>(axis)] ? 0 : ((at == 0 ? 1 : 0) | (at + 1 == count ? 2 : 0)) << (2 * axis);
  }

  const VoxelView& set_;
  Parts& parts_;
};

/// A run of the one begins where a run of the other ends, or the other way round.
template <class Take>
void for_each_meeting(Row a, Row b, const Take& take) {
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i + 1] == b[j] || b[j + 1] == a[i]) take(i / 2);
    (a[i + 1] < b[j + 1] ? i : j) += 2;
  }
}

}  // namespace

Parts parts_of(const VoxelView& set) {
  Parts parts;
  if (!set.row_offset.empty()) Finder(set, parts).run();
  return parts;
}

Buffer<std::uint8_t> adjacent_parts(const VoxelView& set, const Parts& parts, const VoxelView& other) {
  Buffer<std::uint8_t> neighbour(parts.size(), std::uint8_t{0});
  for (std::uint32_t z = 0; z < set.nz; ++z) {
    for (std::uint32_t y = 0; y < set.ny; ++y) {
      const std::size_t r = y + std::size_t{set.ny} * z, first = set.row_offset[r] / 2;
      const Row own = set.row(r), same = other.row(r);
      const auto mark = [&](std::size_t i, std::size_t = 0) { neighbour[parts.part_of(first + i)] = 1; };
      for_each_meeting(own, same, mark);
      if (set.periodic[0] && !own.empty() && !same.empty()) {
        if (own.front() == 0 && same.back() == set.nx) mark(0);
        if (own.back() == set.nx && same.front() == 0) mark(own.size() / 2 - 1);
      }
      const auto inspection = [&](std::uint32_t at_y, std::uint32_t at_z) {
        for_each_overlap(own, other.row(at_y, at_z), mark);
      };
      if (y > 0 || set.periodic[1]) inspection(y > 0 ? y - 1 : set.ny - 1, z);
      if (y + 1 < set.ny || set.periodic[1]) inspection(y + 1 < set.ny ? y + 1 : 0, z);
      if (z > 0 || set.periodic[2]) inspection(y, z > 0 ? z - 1 : set.nz - 1);
      if (z + 1 < set.nz || set.periodic[2]) inspection(y, z + 1 < set.nz ? z + 1 : 0);
    }
  }
  return neighbour;
}

}  // namespace lamina::pores
