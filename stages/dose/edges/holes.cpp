#include "stages/dose/edges/holes.h"

#include <algorithm>

namespace lamina::dose {
namespace {

/// The gaps of an image, numbered from 1 row by row; a row of n runs has n + 1 of them, of which the outer ones may be empty.
struct Gaps {
  RunsView image;
  Buffer<std::uint32_t>& parent;

  std::uint32_t first(std::uint32_t row) const { return 1 + image.row_offset[row] / 2 + row; }
  std::uint32_t count(std::uint32_t row) const { return static_cast<std::uint32_t>(image.row(row).size() / 2) + 1; }
  std::uint32_t begin(std::uint32_t row, std::uint32_t k) const { return k == 0 ? 0 : image.row(row)[2 * k - 1]; }
  std::uint32_t end(std::uint32_t row, std::uint32_t k) const {
    return k + 1 == count(row) ? image.columns : image.row(row)[2 * k];
  }

  std::uint32_t root(std::uint32_t gap) {
    while (parent[gap] != gap) gap = parent[gap] = parent[parent[gap]];
    return gap;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = root(a), b = root(b);
    parent[std::max(a, b)] = std::min(a, b);
  }
};

/// Joins the gaps of a row with those of the next one that share a column with them.
void join_rows(std::uint32_t row, Gaps& gaps) {
  std::uint32_t a = 0, b = 0;
  while (a < gaps.count(row) && b < gaps.count(row + 1)) {
    const std::uint32_t end_a = gaps.end(row, a), end_b = gaps.end(row + 1, b);
    if (std::max(gaps.begin(row, a), gaps.begin(row + 1, b)) < std::min(end_a, end_b))
      gaps.join(gaps.first(row) + a, gaps.first(row + 1) + b);
    if (end_a <= end_b) ++a;
    if (end_b <= end_a) ++b;
  }
}

}  // namespace

void fill_holes(const RunsView& image, HoleScratch& scratch, Runs& filled) {
  const std::uint32_t rows = image.rows();
  Gaps gaps{image, scratch.parent};
  scratch.parent.resize(1 + image.change.size() / 2 + rows);
  for (std::uint32_t gap = 0; gap < scratch.parent.size(); ++gap) scratch.parent[gap] = gap;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::uint32_t first = gaps.first(r), last = first + gaps.count(r) - 1;
    const bool border = r == 0 || r + 1 == rows;
    for (std::uint32_t gap = first; gap <= last; ++gap) {
      const bool outer = (gap == first || gap == last || border) && gaps.begin(r, gap - first) < gaps.end(r, gap - first);
      if (outer) gaps.join(0, gap);
    }
    if (r > 0) join_rows(r - 1, gaps);
  }
  filled.columns = image.columns;
  filled.row_offset.assign(1, 0);
  filled.change.clear();
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto row = image.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      const bool joins = i > 0 && gaps.root(gaps.first(r) + static_cast<std::uint32_t>(i / 2)) != 0;
      if (!joins) filled.change.push_back(row[i]);
      const bool goes_on = i + 2 < row.size() && gaps.root(gaps.first(r) + static_cast<std::uint32_t>(i / 2) + 1) != 0;
      if (!goes_on) filled.change.push_back(row[i + 1]);
    }
    filled.row_offset.push_back(static_cast<std::uint32_t>(filled.change.size()));
  }
}

}  // namespace lamina::dose
