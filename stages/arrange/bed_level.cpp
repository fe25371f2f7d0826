#include "stages/arrange/bed_level.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace lamina::arrange {
namespace {

/// The first clear cell of a row from x on; none without one.
std::optional<std::uint32_t> first_clear(std::span<const std::uint64_t> row, std::uint32_t x) {
  std::uint32_t w = x / 64;
  if (w >= row.size()) return std::nullopt;
  std::uint64_t open = ~row[w] & (~std::uint64_t{0} << (x % 64));
  while (open == 0) {
    if (++w == row.size()) return std::nullopt;
    open = ~row[w];
  }
  return w * 64 + static_cast<std::uint32_t>(std::countr_zero(open));
}

}  // namespace

BedCells bed_cells(const BedOutline& bed, std::span<const KeepOut> keep_out, std::int64_t cell) {
  BedCells cells;
  cells.cell = cell;
  cells.x0 = cells.y0 = bed.margin;
  const std::int64_t width = bed.width - 2 * bed.margin, depth = bed.depth - 2 * bed.margin;
  if (width < cell || depth < cell) return cells;
  cells.blocked = BitShape(static_cast<std::uint32_t>(width / cell), static_cast<std::uint32_t>(depth / cell));
  const double rx = static_cast<double>(width) / 2, ry = static_cast<double>(depth) / 2;
  for (std::uint32_t y = 0; y < cells.blocked.depth; ++y) {
    if (bed.round) {
      // The half width of the ellipse where the row is the furthest from its middle.
      const double a = static_cast<double>(y) * static_cast<double>(cell) - ry, b = a + static_cast<double>(cell);
      const double away = std::max(std::abs(a), std::abs(b)) / ry;
      const double half = away < 1 ? rx * std::sqrt(1 - away * away) : 0;
      const double left = std::ceil((rx - half) / static_cast<double>(cell)),
                   right = std::floor((rx + half) / static_cast<double>(cell));
      const auto from = static_cast<std::uint32_t>(std::clamp<double>(left, 0, cells.blocked.width));
      const auto to = static_cast<std::uint32_t>(std::clamp<double>(right, from, cells.blocked.width));
      cells.blocked.set(y, 0, from);
      cells.blocked.set(y, to, cells.blocked.width);
    }
    for (const KeepOut& box : keep_out) {
      const std::int64_t low = cells.y0 + std::int64_t{y} * cell;
      if (box.hi_y <= low || box.lo_y >= low + cell) continue;
      const auto column = [&](std::int64_t at, bool up) {
        const std::int64_t c = up ? ceil_div(at - cells.x0, cell) : floor_div(at - cells.x0, cell);
        return static_cast<std::uint32_t>(std::clamp<std::int64_t>(c, 0, cells.blocked.width));
      };
      cells.blocked.set(y, column(box.lo_x, false), column(box.hi_x, true));
    }
  }
  return cells;
}

BedLevel::BedLevel(const BedCells& bed, std::size_t shapes) : openings_(bed.blocked), next_(shapes) {}

std::optional<CellPosition> BedLevel::find(std::size_t number, const SearchShape& shape, std::uint32_t below) {
  return find_from(next_[number], shape, below);
}

bool BedLevel::has_space(const SearchShape& shape) {
  CellPosition front;
  return find_from(front, shape, UINT32_MAX).has_value();
}

/// next  no position is before it; moves on
std::optional<CellPosition> BedLevel::find_from(CellPosition& next, const SearchShape& shape, std::uint32_t below) {
  const BitShape& taken = openings_.taken();
  if (shape.square() == 0 || shape.width() > taken.width || shape.depth() > taken.depth) return std::nullopt;
  const BitShape& blocked = openings_.blocked_for(shape.square());
  const std::uint32_t last_x = taken.width - shape.width(), last_y = taken.depth - shape.depth();
  for (; next.y <= last_y && next.y + shape.depth() <= below; ++next.y, next.x = 0) {
    const std::span<const std::uint64_t> row = blocked.row(next.y + shape.square_y());
    while (next.x <= last_x) {
      const auto open = first_clear(row, next.x + shape.square_x());
      if (!open || *open - shape.square_x() > last_x) break;
      next.x = *open - shape.square_x();
      const auto until = blocked_until(shape, taken, next.x, next.y);
      if (!until) return next;
      next.x = *until;
    }
  }
  return std::nullopt;
}

bool BedLevel::is_free(const BitShape& shape, CellPosition at) const {
  const BitShape& taken = openings_.taken();
  if (at.x + shape.width > taken.width || at.y + shape.depth > taken.depth) return false;
  return !blocked_until(SearchShape(shape), taken, at.x, at.y);
}

void BedLevel::put(const GrownShape& grown, CellPosition at) {
  // The grown shape begins `reach` cells before the shape, and may end beyond the bed.
  const BitShape& shape = grown.shape;
  const std::int64_t width = openings_.taken().width, depth = openings_.taken().depth;
  for (std::uint32_t row = 0; row < shape.depth; ++row) {
    const std::int64_t y = std::int64_t{at.y} + row - grown.reach;
    if (y < 0 || y >= depth) continue;
    for_each_run(shape.row(row), shape.width, [&](std::uint32_t begin, std::uint32_t end) {
      const auto column = [&](std::uint32_t c) {
        return static_cast<std::uint32_t>(std::clamp<std::int64_t>(std::int64_t{at.x} + c - grown.reach, 0, width));
      };
      openings_.take(static_cast<std::uint32_t>(y), column(begin), column(end));
    });
  }
}

}  // namespace lamina::arrange
