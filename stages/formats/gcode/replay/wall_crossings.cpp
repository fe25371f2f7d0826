#include "stages/formats/gcode/replay/wall_crossings.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina::formats::gcode {
namespace {

constexpr std::uint32_t kMaxCells = 256;  // along an axis

/// Whether a wall cuts a travel at least `touch` mm from both ends of the travel.
bool cuts(const std::array<double, 4>& travel, const std::array<float, 4>& wall, double touch) {
  const double tx = travel[2] - travel[0], ty = travel[3] - travel[1];
  const double wx = double{wall[2]} - wall[0], wy = double{wall[3]} - wall[1];
  const double cross = tx * wy - ty * wx, length = std::hypot(tx, ty);
  if (cross == 0) return false;  // parallel
  const double dx = wall[0] - travel[0], dy = wall[1] - travel[1];
  const double t = (dx * wy - dy * wx) / cross, w = (dx * ty - dy * tx) / cross;
  return w >= 0 && w <= 1 && t * length >= touch && (1 - t) * length >= touch;
}

}  // namespace

void WallCrossings::wall(const double* from, const double* to) {
  walls_.push_back(
      {{static_cast<float>(from[0]), static_cast<float>(from[1]), static_cast<float>(to[0]), static_cast<float>(to[1])}});
}

void WallCrossings::travel(const double* from, const double* to, FileLine at) {
  constexpr double kFarthestMm = 2000;
  for (const double* end : {from, to}) {
    if (!(std::abs(end[0]) <= kFarthestMm && std::abs(end[1]) <= kFarthestMm)) return;
  }
  travels_.push_back({{from[0], from[1], to[0], to[1]}, at});
}

std::uint32_t WallCrossings::cell_of(double at, std::size_t axis) const {
  const double cell = std::floor((at - low_[axis]) / step_);
  return static_cast<std::uint32_t>(std::clamp(cell, 0.0, cells_[axis] - 1.0));
}

template <class Visit>
bool WallCrossings::each_row(const std::array<double, 4>& ends, Visit visit) const {
  auto [x0, y0, x1, y1] = ends;
  if (y0 > y1) std::swap(x0, x1), std::swap(y0, y1);
  const double slope = y1 > y0 ? (x1 - x0) / (y1 - y0) : 0;
  const std::uint32_t end = cell_of(y1, 1);
  for (std::uint32_t row = cell_of(y0, 1); row <= end; ++row) {
    const double bottom = low_[1] + row * step_, top = bottom + step_;
    const double a = y1 > y0 ? x0 + slope * (std::clamp(bottom, y0, y1) - y0) : x0;
    const double b = y1 > y0 ? x0 + slope * (std::clamp(top, y0, y1) - y0) : x1;
    const std::size_t begin = std::size_t{row} * cells_[0];
    if (visit(begin + cell_of(std::min(a, b), 0), begin + cell_of(std::max(a, b), 0))) return true;
  }
  return false;
}

/// Counting sort of the walls by the cells of their boxes.
void WallCrossings::sort_walls() {
  low_ = {walls_[0].ends[0], walls_[0].ends[1]};
  high_ = low_;
  for (const WallSegment& wall : walls_) {
    for (std::size_t k = 0; k < 4; ++k) {
      low_[k % 2] = std::min<double>(low_[k % 2], wall.ends[k]);
      high_[k % 2] = std::max<double>(high_[k % 2], wall.ends[k]);
    }
  }
  const double longest = std::max({high_[0] - low_[0], high_[1] - low_[1], 1e-3});
  const double wanted = std::clamp(std::sqrt(static_cast<double>(walls_.size())), 1.0, double{kMaxCells});
  step_ = longest / wanted;
  for (std::size_t k = 0; k < 2; ++k) cells_[k] = static_cast<std::uint32_t>((high_[k] - low_[k]) / step_) + 1;
  offset_.assign(std::size_t{cells_[0]} * cells_[1] + 1, 0);
  const auto each_cell = [&](const WallSegment& wall, auto visit) {
    each_row({wall.ends[0], wall.ends[1], wall.ends[2], wall.ends[3]}, [&](std::size_t first, std::size_t last) {
      for (std::size_t cell = first; cell <= last; ++cell) visit(cell);
      return false;
    });
  };
  for (const WallSegment& wall : walls_) each_cell(wall, [&](std::size_t cell) { ++offset_[cell + 1]; });
  for (std::size_t i = 1; i < offset_.size(); ++i) offset_[i] += offset_[i - 1];
  cell_walls_.resize(offset_.back());
  for (std::uint32_t w = 0; w < walls_.size(); ++w)
    each_cell(walls_[w], [&](std::size_t cell) { cell_walls_[offset_[cell]++] = w; });
  for (std::size_t i = offset_.size() - 1; i > 0; --i) offset_[i] = offset_[i - 1];
  offset_[0] = 0;
}

bool WallCrossings::crosses(const OpenTravel& travel) const {
  const auto& [x0, y0, x1, y1] = travel.ends;
  if (std::max(y0, y1) < low_[1] || std::min(y0, y1) > high_[1] || std::max(x0, x1) < low_[0] || std::min(x0, x1) > high_[0])
    return false;
  return each_row(travel.ends, [&](std::size_t first, std::size_t last) {
    for (std::uint32_t i = offset_[first]; i < offset_[last + 1]; ++i) {
      if (cuts(travel.ends, walls_[cell_walls_[i]].ends, kTouchMm)) return true;
    }
    return false;
  });
}

void WallCrossings::end_layer(Defects& defects) {
  if (!walls_.empty() && !travels_.empty()) {
    sort_walls();
    for (const OpenTravel& travel : travels_) {
      if (!crosses(travel)) continue;
      const double length = std::hypot(travel.ends[2] - travel.ends[0], travel.ends[3] - travel.ends[1]);
      defects.add(Defect::kCrossing, travel.at, length, 0);
    }
  }
  walls_.clear();
  travels_.clear();
}

}  // namespace lamina::formats::gcode
