// stages/coverage/row_cells.h: what facets add to the columns of one row, and which columns they reach.
#pragma once

#include <bit>
#include <cstdint>

#include "stages/data/buffer.h"

namespace lamina::cover {

/// How a column differs from the one before it.
struct Cell {
  double cover = 0;           // nm^2 that facets in the column add to what lies behind them
  double partial = 0;         // nm^3 that they add within it
  std::int32_t held = 0;      // facets that begin here, less those that ended in the column before
  std::int32_t suspects = 0;  // of these the suspect ones
};

/// Cells of one row, reused from row to row; touched ones are marked, so that a row costs what lies in it.
class RowCells {
 public:
  /// One cell more than columns. Everything is empty.
  void start(std::uint32_t columns) {
    if (cell_.size() == std::size_t{columns} + 1) return;
    cell_.assign(std::size_t{columns} + 1, {});
    word_.assign(columns / 64 + 1, 0);
    group_.assign(columns / 4096 + 1, 0);
  }
  Cell& touch(std::uint32_t column) {
    word_[column / 64] |= std::uint64_t{1} << column % 64;
    group_[column / 4096] |= std::uint64_t{1} << column / 64 % 64;
    return cell_[column];
  }
  const Cell& at(std::uint32_t column) const { return cell_[column]; }
  /// Empties a cell and says what was in it.
  Cell take(std::uint32_t column) {
    const Cell was = cell_[column];
    cell_[column] = {};
    std::uint64_t& word = word_[column / 64];
    word &= ~(std::uint64_t{1} << column % 64);
    if (word == 0) group_[column / 4096] &= ~(std::uint64_t{1} << column / 64 % 64);
    return was;
  }
  static constexpr std::uint32_t kNone = UINT32_MAX;
  /// The first touched column at or behind `column`, or kNone.
  std::uint32_t next(std::uint32_t column) const {
    std::size_t w = column / 64;
    if (w >= word_.size()) return kNone;
    const std::uint64_t rest = word_[w] & ~std::uint64_t{0} << column % 64;
    if (rest != 0) return static_cast<std::uint32_t>(w * 64) + static_cast<std::uint32_t>(std::countr_zero(rest));
    ++w;
    for (std::size_t g = w / 64; g < group_.size(); ++g) {
      const std::uint64_t words = g == w / 64 ? group_[g] & ~std::uint64_t{0} << w % 64 : group_[g];
      if (words == 0) continue;
      const std::size_t found = g * 64 + static_cast<std::size_t>(std::countr_zero(words));
      return static_cast<std::uint32_t>(found * 64) + static_cast<std::uint32_t>(std::countr_zero(word_[found]));
    }
    return kNone;
  }
  std::uint64_t bytes() const { return bytes_held(cell_) + bytes_held(word_) + bytes_held(group_); }

 private:
  Buffer<Cell> cell_;
  Buffer<std::uint64_t> word_, group_;  // a bit a cell; a bit a word
};

}  // namespace lamina::cover
