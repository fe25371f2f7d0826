#include "stages/stokes/preconditioner.h"

#include <algorithm>

#include "stages/stokes/sums.h"

namespace lamina::stokes {
namespace {

/// The sums of members.
void add_up(const Groups& groups, const Field& members, Field& sums) {
  for_pieces(groups.size(), [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t g = begin; g < end; ++g) {
      Four sum{};
      for (std::uint32_t m = groups.begin[g]; m < groups.begin[g + 1]; ++m) sum += members[m];
      sums[g] = sum;
    }
  });
}

/// Group numbers of the cells become those of the next level.
void climb(const Groups& groups, Buffer<std::uint32_t>& of_cell) {
  std::uint32_t g = 0;
  for (std::uint32_t& group : of_cell) {
    while (group >= groups.begin[g + 1]) ++g;
    group = g;
  }
}

/// What each cell adds to the diagonal of its group: all but what flows between members.
void diagonals_within(const Operator& stokes, const Buffer<std::uint32_t>& of_cell, Field& result) {
  const Cells& cells = stokes.cells();
  for_pieces(cells.size(), [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) {
      Four sum = stokes.faces_of(i).diagonal;
      for (int side = 0; side < 6; ++side) {
        const std::uint32_t n = cells.neighbour[i][static_cast<std::size_t>(side)];
        if (n != cells.size() && of_cell[n] == of_cell[i]) sum -= stokes.weight(side / 2) * stokes.exists(i) * stokes.exists(n);
      }
      result[i] = sum;
    }
  });
}

}  // namespace

Preconditioner::Preconditioner(const Operator& stokes, const std::vector<Groups>& levels, Field& scratch)
    : stokes_(stokes), levels_(levels) {
  Buffer<std::uint32_t> of_cell(stokes.cells().size());
  for (std::uint32_t i = 0; i < of_cell.size(); ++i) of_cell[i] = i;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    climb(levels[level], of_cell);
    diagonals_within(stokes, of_cell, scratch);
    coarse_.push_back({Field(levels[level].size()), Field(levels[level].size())});
    for (std::size_t below = 0; below <= level; ++below)
      add_up(levels[below], below == 0 ? scratch : coarse_[below - 1].sum, coarse_[below].sum);
    Coarse& here = coarse_.back();
    for (std::uint32_t g = 0; g < levels[level].size(); ++g) {
      for (int a = 0; a < 3; ++a) here.inverse[g][a] = here.sum[g][a] > 1e-6f ? 1 / here.sum[g][a] : 0;
      here.inverse[g][3] = 0;
    }
  }
  std::fill(scratch.begin(), scratch.end(), Four{});
}

void Preconditioner::gather() {
  for (std::size_t level = 1; level < levels_.size(); ++level)
    add_up(levels_[level], coarse_[level - 1].sum, coarse_[level].sum);
  for (std::size_t level = levels_.size(); level-- > 0;) {
    Coarse& here = coarse_[level];
    for_pieces(levels_[level].size(), [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t g = begin; g < end; ++g) here.sum[g] *= here.inverse[g];
    });
  }
  for (std::size_t level = levels_.size(); level-- > 1;) {
    const Groups& groups = levels_[level];
    for_pieces(groups.size(), [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t g = begin; g < end; ++g)
        for (std::uint32_t m = groups.begin[g]; m < groups.begin[g + 1]; ++m)
          coarse_[level - 1].sum[m] += coarse_[level].sum[g];
    });
  }
}

}  // namespace lamina::stokes
