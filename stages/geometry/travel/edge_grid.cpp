#include "stages/geometry/travel/edge_grid.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lamina::travel {
namespace {

constexpr double kSlack = 4;  // nm around a line within which cells count as its own: more than the rounding of doubles

/// Twice the area of a triangle, nm2: positive if it is counter-clockwise.
__int128 turn(Point2 a, Point2 b, Point2 c) {
  return static_cast<__int128>(std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - a.y) -
         static_cast<__int128>(std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - a.x);
}

int sign(__int128 value) { return (value > 0) - (value < 0); }

/// Whether the boxes around two lines meet.
bool boxes_meet(Point2 a, Point2 b, Point2 p, Point2 q) {
  return std::max(a.x, b.x) >= std::min(p.x, q.x) && std::max(p.x, q.x) >= std::min(a.x, b.x) &&
         std::max(a.y, b.y) >= std::min(p.y, q.y) && std::max(p.y, q.y) >= std::min(a.y, b.y);
}

bool lines_meet(Point2 a, Point2 b, Point2 p, Point2 q) {
  return boxes_meet(a, b, p, q) && sign(turn(a, b, p)) * sign(turn(a, b, q)) <= 0 &&
         sign(turn(p, q, a)) * sign(turn(p, q, b)) <= 0;
}

}  // namespace

std::int64_t EdgeGrid::column(double x) const {
  return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor((x - low_.x) / cell_)), 0, columns_ - 1);
}

std::int64_t EdgeGrid::row(double y) const {
  return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor((y - low_.y) / cell_)), 0, rows_ - 1);
}

/// Calls visit(cell) for all cells that a line meets, and perhaps for some next to them, until it returns true.
template <class Visit>
bool EdgeGrid::walk(Point2 a, Point2 b, const Visit& visit) const {
  if (a.y > b.y) std::swap(a, b);
  const double slope = a.y == b.y ? 0 : (static_cast<double>(b.x) - a.x) / (static_cast<double>(b.y) - a.y);
  const std::int64_t first = row(a.y - kSlack), last = row(b.y + kSlack);
  for (std::int64_t r = first; r <= last; ++r) {
    double x0 = a.x, x1 = b.x;
    if (first != last) {
      const double bottom = low_.y + static_cast<double>(r) * cell_ - kSlack, top = bottom + cell_ + 2 * kSlack;
      if (bottom > a.y) x0 = a.x + (std::min<double>(bottom, b.y) - a.y) * slope;
      if (top < b.y) x1 = a.x + (std::max<double>(top, a.y) - a.y) * slope;
    }
    const std::int64_t from = column(std::min(x0, x1) - kSlack), to = column(std::max(x0, x1) + kSlack);
    for (std::int64_t c = from; c <= to; ++c) {
      if (visit(static_cast<std::size_t>(r * columns_ + c))) return true;
    }
  }
  return false;
}

EdgeGrid::EdgeGrid(const ContoursView& contours) : contours_(contours) {
  const std::size_t points = contours.point.size();
  if (points == 0) return;
  next_.resize(points);
  Point2 high = low_ = contours.point.front();
  double way = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    for (std::uint32_t i = contours.offset[c]; i < contours.offset[c + 1]; ++i) {
      next_[i] = i + 1 < contours.offset[c + 1] ? i + 1 : contours.offset[c];
      const Point2 p = contours.point[i];
      low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
      way += length_nm(p, contours.point[next_[i]]);
    }
  }
  const double width = static_cast<double>(high.x) - low_.x, depth = static_cast<double>(high.y) - low_.y;
  const auto count = static_cast<double>(points);
  cell_ = std::max({std::sqrt(width * depth / count), way / (2 * count), 16.0});
  columns_ = static_cast<std::int64_t>(width / cell_) + 1;
  rows_ = static_cast<std::int64_t>(depth / cell_) + 1;
  begin_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  const auto for_each_cell = [&](const auto& visit) {
    for (std::uint32_t i = 0; i < points; ++i) walk(from(i), to(i), [&](std::size_t cell) { return visit(i, cell); });
  };
  for_each_cell([&](std::uint32_t, std::size_t cell) { return ++begin_[cell], false; });
  std::exclusive_scan(begin_.begin(), begin_.end(), begin_.begin(), std::uint32_t{0});
  edge_.resize(begin_.back());
  for_each_cell([&](std::uint32_t edge, std::size_t cell) { return edge_[begin_[cell]++] = edge, false; });
  std::copy_backward(begin_.begin(), begin_.end() - 1, begin_.end());
  begin_.front() = 0;
}

std::uint32_t EdgeGrid::contour_of(std::uint32_t edge) const {
  const auto after = std::upper_bound(contours_.offset.begin(), contours_.offset.end(), edge);
  return static_cast<std::uint32_t>(after - contours_.offset.begin()) - 1;
}

std::uint32_t EdgeGrid::before(std::uint32_t edge) const {
  const std::uint32_t contour = contour_of(edge);
  return edge > contours_.offset[contour] ? edge - 1 : contours_.offset[contour + 1] - 1;
}

bool EdgeGrid::crosses(Point2 a, Point2 b) const {
  if (next_.empty()) return false;
  return walk(a, b, [&](std::size_t cell) {
    for (std::uint32_t i = begin_[cell]; i < begin_[cell + 1]; ++i) {
      if (lines_meet(a, b, from(edge_[i]), to(edge_[i]))) return true;
    }
    return false;
  });
}

void EdgeGrid::crossings(Point2 a, Point2 b, Buffer<EdgeCrossing>& found) const {
  found.clear();
  if (next_.empty()) return;
  walk(a, b, [&](std::size_t cell) {
    for (std::uint32_t i = begin_[cell]; i < begin_[cell + 1]; ++i) {
      const std::uint32_t edge = edge_[i];
      if (!lines_meet(a, b, from(edge), to(edge))) continue;
      const auto left = static_cast<double>(turn(from(edge), to(edge), a));
      const auto right = static_cast<double>(turn(from(edge), to(edge), b));
      found.push_back({left == right ? 0 : left / (left - right), edge});
    }
    return false;
  });
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end()), found.end());  // an edge is in several cells
}

bool EdgeGrid::contains(Point2 p) const {
  if (next_.empty() || p.x < low_.x || p.y < low_.y) return false;
  // A ray to the left. An edge counts in the one cell where it meets the ray's line.
  const std::int64_t r = row(p.y), last = column(p.x);
  bool odd = false;
  for (std::int64_t c = 0; c <= last; ++c) {
    const auto cell = static_cast<std::size_t>(r * columns_ + c);
    for (std::uint32_t i = begin_[cell]; i < begin_[cell + 1]; ++i) {
      Point2 a = from(edge_[i]), b = to(edge_[i]);
      if ((a.y <= p.y) == (b.y <= p.y)) continue;
      if (a.y > b.y) std::swap(a, b);
      if (turn(a, b, p) >= 0) continue;  // to the right of the point, as the line goes up
      const double share = (static_cast<double>(p.y) - a.y) / (static_cast<double>(b.y) - a.y);
      odd ^= column(a.x + share * (static_cast<double>(b.x) - a.x)) == c;
    }
  }
  return odd;
}

}  // namespace lamina::travel
