#include "stages/arrange/search_shape.h"

#include <algorithm>
#include <bit>

namespace lamina::arrange {
namespace {

/// The last set cell of [begin, end) of a row; none without one.
std::optional<std::uint32_t> last_set(std::span<const std::uint64_t> row, std::uint32_t begin, std::uint32_t end) {
  const std::uint32_t first = begin / 64;
  std::uint32_t w = (end - 1) / 64;
  std::uint64_t word = row[w] & (~std::uint64_t{0} >> (63 - (end - 1) % 64));
  for (;; word = row[--w]) {
    if (w == first) word &= ~std::uint64_t{0} << (begin % 64);
    if (word != 0) return w * 64 + 63 - static_cast<std::uint32_t>(std::countl_zero(word));
    if (w == first) return std::nullopt;
  }
}

/// The bits of a number, `digits` of them, from the other end.
std::uint32_t reversed(std::uint32_t number, int digits) {
  std::uint32_t result = 0;
  for (int i = 0; i < digits; ++i) result |= (number >> i & 1) << (digits - 1 - i);
  return result;
}

}  // namespace

SearchShape::SearchShape(const BitShape& shape) : width_(shape.width), depth_(shape.depth) {
  const int digits = std::bit_width(depth_);
  for (std::uint32_t i = 0; i < (1u << digits); ++i) {
    const std::uint32_t row = reversed(i, digits);
    if (row >= depth_) continue;
    for_each_run(shape.row(row), shape.width, [&](std::uint32_t begin, std::uint32_t end) {
      runs_.push_back({row, begin, end});
    });
  }
  find_square(shape);
}

/// Of each cell the largest square that ends there: one more than the least of those of its three neighbours.
void SearchShape::find_square(const BitShape& shape) {
  std::vector<std::uint32_t> above(width_ + 1), row(width_ + 1);
  for (std::uint32_t y = 0; y < depth_; ++y) {
    for (std::uint32_t x = 0; x < width_; ++x) {
      row[x + 1] = shape.at(x, y) ? 1 + std::min({row[x], above[x], above[x + 1]}) : 0;
      if (row[x + 1] <= square_) continue;
      square_ = row[x + 1];
      square_x_ = x + 1 - square_;
      square_y_ = y + 1 - square_;
    }
    std::swap(above, row);
  }
}

std::optional<std::uint32_t> blocked_until(const SearchShape& shape, const BitShape& taken, std::uint32_t x, std::uint32_t y) {
  for (const CellRun& run : shape.runs()) {
    if (const auto cell = last_set(taken.row(y + run.row), x + run.begin, x + run.end)) return *cell - run.begin + 1;
  }
  return std::nullopt;
}

}  // namespace lamina::arrange
