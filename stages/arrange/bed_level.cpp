#include "stages/arrange/bed_level.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace lamina::arrange {
namespace {

/// out[x] = in[x + by]; beyond the row there are set cells.
void read_ahead(std::span<const std::uint64_t> in, std::uint32_t by, std::vector<std::uint64_t>& out) {
  const std::size_t words = by / 64, bits = by % 64;
  const auto word = [&](std::size_t w) { return w < in.size() ? in[w] : ~std::uint64_t{0}; };
  for (std::size_t w = 0; w < out.size(); ++w) {
    std::uint64_t value = word(w + words) >> bits;
    if (bits > 0) value |= word(w + words + 1) << (64 - bits);
    out[w] = value;
  }
}

/// row[x] becomes the union of row[x .. x + length), length >= 1.
void take_windows(std::vector<std::uint64_t>& row, std::uint32_t length) {
  for (std::uint32_t done = 1; done < length;) {
    const std::uint32_t step = std::min(done, length - done);
    const std::size_t words = step / 64, bits = step % 64;
    for (std::size_t w = 0; w < row.size(); ++w) {
      const auto word = [&](std::size_t i) { return i < row.size() ? row[i] : ~std::uint64_t{0}; };
      std::uint64_t value = word(w + words) >> bits;
      if (bits > 0) value |= word(w + words + 1) << (64 - bits);
      row[w] |= value;
    }
    done += step;
  }
}

/// Calls use(begin, end) for each run of set cells of a row.
template <class Use>
void for_each_run(std::span<const std::uint64_t> row, std::uint32_t width, Use use) {
  std::uint32_t x = 0;
  const auto skip = [&](bool set) {
    while (x < width) {
      const std::uint64_t word = (set ? ~row[x / 64] : row[x / 64]) >> (x % 64);
      if (word != 0) {
        x = std::min(width, x + static_cast<std::uint32_t>(std::countr_zero(word)));
        return;
      }
      x = std::min(width, (x / 64 + 1) * 64);
    }
  };
  for (;;) {
    skip(false);
    if (x >= width) return;
    const std::uint32_t begin = x;
    skip(true);
    use(begin, x);
  }
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

BedLevel::BedLevel(const BedCells& bed, std::size_t shapes)
    : taken_(bed.blocked), next_(shapes), hit_(taken_.words()), window_(taken_.words()) {}

/// Whether the shape has a position in rows from y on, at column `from` or to the right of it.
bool BedLevel::free_at(const BitShape& shape, std::uint32_t y, std::uint32_t from, std::uint32_t& x) {
  std::ranges::fill(hit_, 0);
  const std::uint32_t last = taken_.width - shape.width;  // the last column
  if (from > last) return false;
  for (std::uint32_t row = 0; row < shape.depth; ++row) {
    ++steps_;
    for_each_run(shape.row(row), shape.width, [&](std::uint32_t begin, std::uint32_t end) {
      read_ahead(taken_.row(y + row), begin, window_);
      take_windows(window_, end - begin);
      for (std::size_t w = 0; w < hit_.size(); ++w) hit_[w] |= window_[w];
    });
    constexpr std::uint32_t kChecked = 8;  // rows
    if (row % kChecked == 0 && std::ranges::all_of(hit_, [](std::uint64_t word) { return ~word == 0; })) return false;
  }
  for (std::uint32_t w = from / 64; w <= last / 64; ++w) {
    std::uint64_t open = ~hit_[w];
    if (w == from / 64) open &= ~std::uint64_t{0} << (from % 64);
    if (open == 0) continue;
    x = w * 64 + static_cast<std::uint32_t>(std::countr_zero(open));
    return x <= last;
  }
  return false;
}

std::optional<CellPosition> BedLevel::find(std::size_t number, const BitShape& shape, std::uint32_t below) {
  if (shape.width == 0 || shape.width > taken_.width || shape.depth > taken_.depth) return std::nullopt;
  CellPosition& next = next_[number];
  for (; next.y + shape.depth <= taken_.depth && next.y + shape.depth <= below; ++next.y, next.x = 0) {
    if (free_at(shape, next.y, next.x, next.x)) return next;
  }
  return std::nullopt;
}

bool BedLevel::is_free(const BitShape& shape, CellPosition at) const {
  if (at.x + shape.width > taken_.width || at.y + shape.depth > taken_.depth) return false;
  bool free = true;
  for (std::uint32_t row = 0; row < shape.depth && free; ++row) {
    for_each_run(shape.row(row), shape.width, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t x = begin; x < end; ++x) free = free && !taken_.at(at.x + x, at.y + row);
    });
  }
  return free;
}

void BedLevel::put(const GrownShape& grown, CellPosition at) {
  // The grown shape begins `reach` cells before the shape, and may end beyond the bed.
  const BitShape& shape = grown.shape;
  for (std::uint32_t row = 0; row < shape.depth; ++row) {
    const std::int64_t y = std::int64_t{at.y} + row - grown.reach;
    if (y < 0 || y >= std::int64_t{taken_.depth}) continue;
    for_each_run(shape.row(row), shape.width, [&](std::uint32_t begin, std::uint32_t end) {
      const auto column = [&](std::uint32_t c) {
        return static_cast<std::uint32_t>(std::clamp<std::int64_t>(std::int64_t{at.x} + c - grown.reach, 0, taken_.width));
      };
      taken_.set(static_cast<std::uint32_t>(y), column(begin), column(end));
    });
  }
}

}  // namespace lamina::arrange
