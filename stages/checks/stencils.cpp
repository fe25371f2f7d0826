#include "stages/checks/stencils.h"

#include <algorithm>

namespace lamina::inspect {

// A stencil grows by a column where its width in nm passes a whole number of them, and so by a row. Where it does both, two of
// three times or so it grows along a diagonal: a regular octagon has 2 - sqrt(2) of its width there, about 41 of 70.
Stencils::Stencils(const PixelGrid& grid, std::int64_t least_nm) {
  const auto ends = [](std::uint32_t pixels, const PixelAxis& one, const PixelAxis& other) {
    return static_cast<__int128>(pixels) * one.span * other.dots;
  };
  // Less one: so many whole pixels in nm, rounded, are no pixel more.
  const __int128 least = static_cast<__int128>(least_nm - 1) * grid.x.dots * grid.y.dots;
  Sum sum;
  sums_.push_back(sum);
  for (std::uint32_t both = 0;;) {
    const __int128 column = ends(sum.columns(), grid.x, grid.y), row = ends(sum.rows(), grid.y, grid.x);
    const __int128 next = std::min(column, row);
    if (next >= least || sum.columns() > grid.columns() || sum.rows() > grid.rows()) return;
    if (column != row) {
      ++(column < row ? sum.right : sum.down);
    } else if (const std::uint32_t diagonal = (41 * both++ + 17) / 70; diagonal == sum.falling + sum.rising) {
      ++sum.right;
      ++sum.down;
    } else {
      ++(diagonal % 2 == 1 ? sum.falling : sum.rising);
    }
    sums_.push_back(sum);
  }
}

std::uint64_t Stencils::two_squares(std::uint32_t number) const {
  return std::uint64_t{2} * sums_[number].columns() * sums_[number].rows();
}

Stencil Stencils::at(std::uint32_t number) const {
  const Sum& sum = sums_[number];
  // The point of a row that is farthest to the left lies on a diagonal step for each row beyond those that go straight down.
  const auto first = [&](std::uint32_t row) {
    if (row < sum.rising) return sum.rising - row;
    return row > sum.rising + sum.down ? row - sum.rising - sum.down : 0;
  };
  Stencil stencil;
  stencil.columns = sum.columns();
  for (std::uint32_t row = 0; row < sum.rows(); ++row) {
    stencil.rows.push_back({first(row), stencil.columns - 1 - first(sum.rows() - 1 - row)});
  }
  return stencil;
}

}  // namespace lamina::inspect
