#include "stages/view/picture/layout.h"

#include <algorithm>
#include <cmath>

namespace lamina::view::picture {
namespace {

// Sizes on a sheet of this width; others in proportion, within limits at which text can still be read.
constexpr double kDesignWidth = 2400;
constexpr double kMinScale = 0.45, kMaxScale = 2;
constexpr double kWantedProportion = 1.5;
// A cell is at most so many times as high as it is wide; a picture that is higher becomes narrower.
constexpr int kMaxHeight = 3;

int scaled(double size, double scale) { return static_cast<int>(std::lround(size * scale)); }

SheetLayout with_columns(int columns, int cells, double proportion, int width, double scale) {
  SheetLayout layout{};
  layout.width = width;
  layout.margin = scaled(56, scale);
  layout.gap = scaled(36, scale);
  layout.title_size = scaled(34, scale);
  layout.title_height = scaled(72, scale);
  layout.columns = columns;
  layout.cell_width = std::max(16, (width - 2 * layout.margin - (columns - 1) * layout.gap) / columns);
  layout.caption_size = std::clamp(layout.cell_width / 14, 9, scaled(26, scale));
  layout.caption_height = layout.caption_size * 3 / 2;
  const double height = layout.cell_width * proportion;
  layout.cell_height = std::max(1, static_cast<int>(std::lround(std::min<double>(height, kMaxHeight * layout.cell_width))));
  layout.picture_height = layout.cell_height;
  layout.picture_width = std::clamp(static_cast<int>(std::lround(layout.cell_height / proportion)), 1, layout.cell_width);
  const int rows = (cells + columns - 1) / columns;
  layout.height =
      2 * layout.margin + layout.title_height + rows * (layout.cell_height + layout.caption_height) + (rows - 1) * layout.gap;
  return layout;
}

/// 0 is best: far from the wanted proportion, or with places left empty in the last row, is worse.
double badness(const SheetLayout& layout, int cells) {
  const int positions = (cells + layout.columns - 1) / layout.columns * layout.columns;
  return std::abs(std::log(static_cast<double>(layout.width) / layout.height / kWantedProportion)) +
         static_cast<double>(positions - cells) / cells;
}

}  // namespace

PixelWindow with_margin(const PixelWindow& window, const PixelGrid& grid) {
  const PixelWindow bed{0, grid.columns(), 0, grid.rows()};
  if (window.empty()) return bed;
  // 4 % of the longer side in mm, at least 3 pixels.
  const double side =
      std::max(static_cast<double>(window.width()) / grid.x.dpi(), static_cast<double>(window.height()) / grid.y.dpi());
  const auto x = static_cast<std::uint32_t>(std::max(3.0, side * 0.04 * grid.x.dpi()));
  const auto y = static_cast<std::uint32_t>(std::max(3.0, side * 0.04 * grid.y.dpi()));
  return {window.left - std::min(window.left, x), std::min(bed.right, window.right + x), window.top - std::min(window.top, y),
          std::min(bed.bottom, window.bottom + y)};
}

SheetLayout layout_chart(int cells, const PixelWindow& window, const PixelGrid& grid, int width) {
  const double scale = std::clamp(width / kDesignWidth, kMinScale, kMaxScale);
  const double proportion =
      static_cast<double>(window.height()) / grid.y.dpi() * grid.x.dpi() / static_cast<double>(window.width());
  if (cells == 1) {
    const SheetLayout frame = with_columns(1, 1, proportion, width, scale);
    // A layer alone is not made larger than its pixels, but its caption needs some room.
    const int pixels = std::max(static_cast<int>(window.width()), scaled(640, scale));
    return with_columns(1, 1, proportion, std::min(width, pixels + 2 * frame.margin), scale);
  }
  SheetLayout best = with_columns(1, cells, proportion, width, scale);
  for (int columns = 2; columns <= cells; ++columns) {
    const SheetLayout layout = with_columns(columns, cells, proportion, width, scale);
    if (layout.cell_width * columns > width) break;
    if (badness(layout, cells) < badness(best, cells)) best = layout;
  }
  return best;
}

}  // namespace lamina::view::picture
