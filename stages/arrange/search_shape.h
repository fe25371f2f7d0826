// stages/arrange/search_shape.h: a shape as a search for positions takes it: runs of cells, and the largest square in it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stages/arrange/silhouette.h"

namespace lamina::arrange {

/// Cells [begin, end) of a row.
struct CellRun {
  std::uint32_t row = 0, begin = 0, end = 0;
};

/// Runs in an order that finds taken cells early: rows far from each other first.
class SearchShape {
 public:
  SearchShape() = default;
  /// cost  O(cells)
  explicit SearchShape(const BitShape& shape);

  std::uint32_t width() const { return width_; }
  std::uint32_t depth() const { return depth_; }
  std::span<const CellRun> runs() const { return runs_; }
  /// The largest square of set cells, by its front left one.
  std::uint32_t square() const { return square_; }
  std::uint32_t square_x() const { return square_x_; }
  std::uint32_t square_y() const { return square_y_; }

 private:
  void find_square(const BitShape& shape);

  std::uint32_t width_ = 0, depth_ = 0;
  std::uint32_t square_ = 0, square_x_ = 0, square_y_ = 0;
  std::vector<CellRun> runs_;
};

/// How far to the right a shape with its first cell at (x, y) has to go to leave a taken cell of one of its runs behind; none
/// if all its cells are free. The shape lies within the rows.
std::optional<std::uint32_t> blocked_until(const SearchShape& shape, const BitShape& taken, std::uint32_t x, std::uint32_t y);

}  // namespace lamina::arrange
