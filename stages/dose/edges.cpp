#include "stages/dose/edges.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stages/geometry/combine.h"

namespace lamina::dose {
namespace {

using Row = std::span<const std::uint32_t>;

/// Appends [begin, end) to runs whose begins rise; joins what touches.
void append(std::uint32_t begin, std::uint32_t end, Buffer<std::uint32_t>& runs) {
  if (runs.empty() || runs.back() < begin) {
    runs.push_back(begin);
    runs.push_back(end);
  } else {
    runs.back() = std::max(runs.back(), end);
  }
}

/// The runs of `merged` with those of `row`, each longer by `width` at both ends.
void merge(Row merged, Row row, std::uint32_t width, std::uint32_t columns, Buffer<std::uint32_t>& result) {
  result.clear();
  std::size_t u = 0;
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    const std::uint32_t begin = row[i] > width ? row[i] - width : 0;
    for (; u + 1 < merged.size() && merged[u] <= begin; u += 2) append(merged[u], merged[u + 1], result);
    append(begin, columns - row[i + 1] > width ? row[i + 1] + width : columns, result);
  }
  for (; u + 1 < merged.size(); u += 2) append(merged[u], merged[u + 1], result);
}

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

EdgeMove edge_move(const PixelGrid& grid, const BleedUm& um) {
  return {reach_of(grid, std::llround(std::abs(um[0]) * 1000), std::llround(std::abs(um[1]) * 1000)), um[0] < 0 || um[1] < 0};
}

void move_edge(const RunsView& image, const Reach& reach, bool grows, Runs& result) {
  grows ? dilate(image, reach, result) : erode(image, reach, result);
}

/// A layer's image with moved edges. What stands in a hole has the edges of that hole.
void move_edges(const RunsView& image, const Bleed& bleed, BleedWork& work, Runs& result) {
  if (bleed.outside == bleed.holes) return move_edge(image, bleed.outside.reach, bleed.outside.grows, result);
  Runs &filled = work.second, &holes = work.third, &moved = work.fourth;
  fill_holes(image, work.holes, filled);
  combine(filled, image, SetOperation::kDifference, holes);
  // What is set grows into a hole where the hole shrinks.
  if (bleed.holes.any()) {
    move_edge(holes, bleed.holes.reach, !bleed.holes.grows, moved);
    std::swap(holes, moved);
  }
  if (bleed.outside.any()) {
    move_edge(filled, bleed.outside.reach, bleed.outside.grows, moved);
    std::swap(filled, moved);
  }
  combine(filled, holes, SetOperation::kDifference, result);
}

}  // namespace

Reach reach_of(const PixelGrid& grid, std::int64_t x_nm, std::int64_t y_nm) {
  Reach reach;
  if (x_nm <= 0 && y_nm <= 0) return reach;
  const auto picometres = [](const PixelAxis& axis) {
    return std::llround(static_cast<double>(axis.span) * 1000 / static_cast<double>(axis.dots));
  };
  const __int128 px = picometres(grid.x), py = picometres(grid.y), x = x_nm, y = y_nm;
  const auto within = [&](std::int64_t i, std::int64_t j) {
    const __int128 along = i * px, across = j * py;  // picometres
    if (i == 0 || j == 0) return along <= x * 1000 && across <= y * 1000;
    if (x == 0 || y == 0) return false;
    if (x == y) return along * along + across * across <= x * x * 1'000'000;
    return along * along * y * y + across * across * x * x <= x * x * y * y * 1'000'000;
  };
  auto width = static_cast<std::int64_t>(x * 1000 / px);
  for (std::int64_t j = 0; within(0, j); ++j) {
    while (width > 0 && !within(width, j)) --width;
    reach.half_width.push_back(static_cast<std::uint32_t>(width));
  }
  return reach;
}

void dilate(const RunsView& image, const Reach& reach, Runs& result) {
  const std::int64_t rows = image.rows(), far = static_cast<std::int64_t>(reach.half_width.size()) - 1;
  result.columns = image.columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
  Buffer<std::uint32_t> merged, next;
  for (std::int64_t r = 0; r < rows; ++r) {
    const Row own = image.row(static_cast<std::uint32_t>(r));
    merged.assign(own.begin(), own.end());
    for (std::int64_t j = -far; j <= far; ++j) {
      if (r + j < 0 || r + j >= rows) continue;
      const Row row = image.row(static_cast<std::uint32_t>(r + j));
      if (row.empty()) continue;
      merge(merged, row, reach.half_width[static_cast<std::size_t>(j < 0 ? -j : j)], image.columns, next);
      std::swap(merged, next);
    }
    result.change.insert(result.change.end(), merged.begin(), merged.end());
    result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size()));
  }
}

bool grows_beyond(const RunsView& image, const Reach& reach) {
  if (reach.half_width.empty()) return false;
  const std::uint32_t rows = image.rows(), width = reach.half_width[0];
  const auto far = static_cast<std::uint32_t>(reach.half_width.size()) - 1;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const Row row = image.row(r);
    if (row.empty()) continue;
    if (r < far || rows - 1 - r < far || row.front() < width || image.columns - row.back() < width) return true;
  }
  return false;
}

void fill_holes(const RunsView& image, Buffer<std::uint32_t>& parent, Runs& filled) {
  const std::uint32_t rows = image.rows();
  Gaps gaps{image, parent};
  parent.resize(1 + image.change.size() / 2 + rows);
  std::iota(parent.begin(), parent.end(), 0u);
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
      const std::uint32_t gap = gaps.first(r) + static_cast<std::uint32_t>(i / 2);  // before the run
      if (i == 0 || gaps.root(gap) == 0) filled.change.push_back(row[i]);
      if (i + 2 >= row.size() || gaps.root(gap + 1) == 0) filled.change.push_back(row[i + 1]);
    }
    filled.row_offset.push_back(static_cast<std::uint32_t>(filled.change.size()));
  }
}

Bleed bleed_of(const PixelGrid& grid, const BleedUm& outside, const BleedUm& holes) {
  return {edge_move(grid, outside), edge_move(grid, holes)};
}

std::uint64_t BleedWork::bytes() const {
  std::uint64_t total = bytes_held(holes);
  for (const Runs* runs : {&moved, &second, &third, &fourth}) total += bytes_held(runs->row_offset) + bytes_held(runs->change);
  return total;
}

bool Bleeds::any() const {
  return std::ranges::any_of(
      zones_, [&](const ZoneBleed& zone) { return zone.above.any() || (first_layers_ > 0 && zone.first.any()); });
}

bool Bleeds::grows() const {
  return std::ranges::any_of(
      zones_, [&](const ZoneBleed& zone) { return zone.above.grows() || (first_layers_ > 0 && zone.first.grows()); });
}

std::uint32_t Bleeds::max_rows() const {
  std::size_t maximum = 0;
  for (const ZoneBleed& zone : zones_) {
    for (const Bleed* bleed : {&zone.above, &zone.first})
      maximum = std::max({maximum, bleed->outside.reach.half_width.size(), bleed->holes.reach.half_width.size()});
  }
  return static_cast<std::uint32_t>(maximum);
}

void Bleeds::remove(const Layer& layer, Runs& image, std::span<Runs> zone, BleedWork& work) const {
  if (zones_.size() == 1) {
    const Bleed& bleed = of(0, layer);
    if (!bleed.any()) return;
    move_edges(image, bleed, work, work.moved);
    return std::swap(image, work.moved);
  }
  // First all that stays within the layer: a border with another part is no edge. Then what grows out of it.
  const Runs whole = image;
  const auto deposit = [&](Runs& own) {
    combine(image, own, SetOperation::kUnion, work.second);
    std::swap(image, work.second);
  };
  image.change.clear();
  std::ranges::fill(image.row_offset, 0);
  std::vector<Runs> grown(zone.size());
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    const Bleed& bleed = of(z, layer);
    if (bleed.grows()) {
      move_edges(zone[z], bleed, work, work.moved);
      combine(work.moved, whole, SetOperation::kDifference, grown[z]);
    }
    if (bleed.any()) {
      move_edges(whole, bleed, work, work.moved);
      combine(work.moved, zone[z], SetOperation::kIntersection, work.second);
      std::swap(zone[z], work.second);
    }
    deposit(zone[z]);
  }
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    if (grown[z].change.empty()) continue;
    combine(grown[z], image, SetOperation::kDifference, work.moved);
    combine(zone[z], work.moved, SetOperation::kUnion, work.second);
    std::swap(zone[z], work.second);
    deposit(zone[z]);
  }
}

}  // namespace lamina::dose
