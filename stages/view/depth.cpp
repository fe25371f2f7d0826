#include "stages/view/depth.h"

#include <algorithm>
#include <cmath>

namespace lamina::view {
namespace {

constexpr std::uint32_t kMax = 360;

}  // namespace

ThreeViews::ThreeViews(const PixelGrid& grid, const PixelWindow& window, Nm bottom, Nm top)
    : window_(window), bottom_(bottom), top_(top) {
  const double width = window.width() / grid.x.pixels_per_nm(), depth = window.height() / grid.y.pixels_per_nm();
  const double height = static_cast<double>(std::int64_t{top} - bottom), longest = std::max({width, depth, height});
  const auto cells = [&](double side) {
    return std::clamp(static_cast<std::uint32_t>(std::lround(side / longest * kMax)), 1u, kMax);
  };
  columns_ = cells(width);
  rows_ = cells(depth);
  levels_ = cells(height);
  const auto view = [&](const char* name, std::uint32_t w, std::uint32_t h, std::uint32_t maximum, double w_nm, double h_nm) {
    return DepthView{name, w, h, maximum, w_nm / kNmPerMm, h_nm / kNmPerMm, std::vector<std::uint16_t>(std::size_t{w} * h)};
  };
  views_ = {view("top", columns_, rows_, levels_, width, depth), view("front", columns_, levels_, rows_, width, height),
            view("side", rows_, levels_, columns_, depth, height)};
}

void ThreeViews::inspect(RowRuns image, std::vector<std::uint8_t>& cells) const {
  cells.resize(std::size_t{columns_} * rows_);
  box_coverage(image, window_, columns_, cells);
}

void ThreeViews::add(const Layer& layer, const std::vector<std::uint8_t>& cells) {
  const double height = static_cast<double>(std::int64_t{top_} - bottom_);
  const auto level = [&](std::int64_t z) { return static_cast<double>(z - bottom_) / height * levels_; };
  const auto first = static_cast<std::uint32_t>(std::clamp(level(layer.bottom), 0.0, levels_ - 1.0));
  const auto end = static_cast<std::uint32_t>(
      std::clamp(std::ceil(level(std::int64_t{layer.bottom} + layer.thickness)), first + 1.0, static_cast<double>(levels_)));
  auto& [top, front, side] = views_;
  const auto nearer = [](DepthView& view, std::uint32_t x, std::uint32_t y, std::uint32_t depth) {
    std::uint16_t& have = view.depth[std::size_t{y} * view.width + x];
    have = std::max(have, static_cast<std::uint16_t>(depth));
  };
  for (std::uint32_t row = 0; row < rows_; ++row) {
    for (std::uint32_t column = 0; column < columns_; ++column) {
      if (cells[std::size_t{row} * columns_ + column] < 128) continue;
      nearer(top, column, row, end);
      for (std::uint32_t z = first; z < end; ++z) {
        // Image row 0 is the back: rows further down are nearer to the front.
        nearer(front, column, levels_ - 1 - z, row + 1);
        // From the right the front is on the left.
        nearer(side, rows_ - 1 - row, levels_ - 1 - z, column + 1);
      }
    }
  }
}

}  // namespace lamina::view
