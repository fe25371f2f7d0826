#include "stages/view/picture/swath_view.h"

#include <algorithm>
#include <cmath>

#include "stages/geometry/coverage.h"
#include "stages/view/picture/canvas.h"

namespace lamina::view::picture {
namespace {

constexpr Colour kGround{255, 255, 255}, kBed{247, 247, 244}, kOdd{236, 240, 245}, kPresent{255, 240, 214};
constexpr Colour kEdge{176, 182, 190}, kRequested{150, 160, 175}, kFired{24, 44, 92}, kNozzle{150, 95, 20}, kFires{225, 20, 20};
constexpr Colour kText{40, 44, 52};

}  // namespace

Result<Buffer<std::byte>> swath_picture(const SwathView& view) {
  const int margin = 24, title = 34, caption = 30;
  const int wide = static_cast<int>(view.width) - 2 * margin;
  const double columns = view.grid.columns(), rows = view.grid.rows();
  // Pixels of the picture a pixel of the bed, across and down: the bed keeps its shape where its pixels are not square.
  const double sx = wide / columns, sy = sx * view.grid.x.dpi() / view.grid.y.dpi();
  const int high = std::max(1, static_cast<int>(std::lround(rows * sy)));
  Canvas canvas(static_cast<int>(view.width), high + 2 * margin + title + caption, kGround);
  const int left = margin, top = margin + title;
  canvas.text(left, margin + 16, 17, view.title, kText);
  canvas.fill_box(left, top, wide, high, kBed);
  const auto box = [&](double x0, double y0, double x1, double y1, Colour colour) {
    const int l = std::clamp(static_cast<int>(std::lround(x0 * sx)), 0, wide),
              r = std::clamp(static_cast<int>(std::lround(x1 * sx)), 0, wide);
    const int t = std::clamp(static_cast<int>(std::lround(y0 * sy)), 0, high),
              b = std::clamp(static_cast<int>(std::lround(y1 * sy)), 0, high);
    if (r > l && b > t) canvas.fill_box(left + l, top + t, r - l, b - t, colour);
  };
  // Sweeps of several drops pass over one place: it has one colour, that of the present one before all.
  bool odd = true;
  const SwathBand* last = nullptr;
  for (const SwathBand& band : view.bands) {
    if (last == nullptr || last->left != band.left || last->top != band.top) odd = !odd;
    box(band.left, band.top, band.right, band.bottom, odd ? kOdd : kBed);
    last = &band;
  }
  for (const SwathBand& band : view.bands) {
    if (band.present) box(band.left, band.top, band.right, band.bottom, kPresent);
  }
  const double line_x = 1 / sx, line_y = 1 / sy;
  for (const SwathBand& band : view.bands) {
    box(band.left, band.top, band.right, band.top + line_y, kEdge);
    box(band.left, band.bottom - line_y, band.right, band.bottom, kEdge);
    box(band.left, band.top, band.left + line_x, band.bottom, kEdge);
    box(band.right - line_x, band.top, band.right, band.bottom, kEdge);
  }
  const PixelWindow window{0, view.grid.columns(), 0, view.grid.rows()};
  Buffer<std::uint8_t> shares(static_cast<std::size_t>(wide) * static_cast<std::size_t>(high));
  const auto paint = [&](const LevelsView& levels, Colour ink) {
    box_coverage(levels, view.maximum, window, static_cast<std::uint32_t>(wide), shares);
    for (int row = 0; row < high; ++row) {
      canvas.paint(left, top + row, wide,
                   std::span(shares).subspan(static_cast<std::size_t>(row) * static_cast<std::size_t>(wide),
                                             static_cast<std::size_t>(wide)),
                   ink);
    }
  };
  paint(view.image, kRequested);
  paint(view.fired, kFired);
  const double radius = std::max(0.5, 1.6 / sx);
  for (const NozzlePosition& nozzle : view.nozzles) {
    box(nozzle.column + 0.5 - radius, nozzle.row + 0.5 - radius * sx / sy, nozzle.column + 0.5 + radius,
        nozzle.row + 0.5 + radius * sx / sy, nozzle.fires ? kFires : kNozzle);
  }
  canvas.text(left, top + high + 22, 14, view.caption, kText);
  return canvas.png();
}

}  // namespace lamina::view::picture
