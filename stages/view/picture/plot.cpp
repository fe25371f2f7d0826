#include "stages/view/picture/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/geometry/clipping.h"
#include "stages/view/picture/canvas.h"

namespace lamina::view::picture {
namespace {

constexpr int kMaxPixels = 20'000;
constexpr double kNmPerPixel = 100'000;  // contours are whole nm

int rounded(double pixels) { return static_cast<int>(std::lround(pixels)); }

Colour colour_of(const std::string& rgb) {
  const unsigned long all = std::strtoul(rgb.c_str(), nullptr, 16);
  return {static_cast<std::uint8_t>(all >> 16), static_cast<std::uint8_t>(all >> 8), static_cast<std::uint8_t>(all)};
}

/// A pen `width` pixels wide along points, over what is there.
Status stroke(Canvas& canvas, const std::vector<std::array<double, 2>>& points, double width, double opacity, Colour ink) {
  Contours line;
  double left = 1e9, top = 1e9, right = -1e9, bottom = -1e9;
  for (const auto& [x, y] : points) {
    line.point.push_back({static_cast<Nm>(std::lround(x * kNmPerPixel)), static_cast<Nm>(std::lround(-y * kNmPerPixel))});
    left = std::min(left, x - width), right = std::max(right, x + width);
    top = std::min(top, y - width), bottom = std::max(bottom, y + width);
  }
  line.close();
  const auto covered = cover_lines(line, static_cast<Nm>(std::lround(width * kNmPerPixel)));
  if (!covered) return covered.error();
  const int l = std::clamp(static_cast<int>(left), 0, canvas.width()),
            r = std::clamp(static_cast<int>(right) + 1, l, canvas.width());
  const int t = std::clamp(static_cast<int>(top), 0, canvas.height()),
            b = std::clamp(static_cast<int>(bottom) + 1, t, canvas.height());
  if (l == r || t == b) return {};
  auto shares = contour_shares(*covered, {l * kNmPerPixel, -t * kNmPerPixel, 1 / kNmPerPixel}, r - l, b - t);
  for (std::uint8_t& share : shares) share = static_cast<std::uint8_t>(share * opacity);
  canvas.paint(l, t, r - l, shares, ink);
  return {};
}

/// errors  kUsage: no image
Status put(Canvas& canvas, const Plot::Image& image) {
  const auto columns = static_cast<std::size_t>(image.columns);
  const auto has_colour = [&](std::uint8_t pixel) { return pixel < image.colours.size(); };
  if (image.columns < 1 || image.pixels.size() % columns != 0 || !std::ranges::all_of(image.pixels, has_colour))
    return Error{Fault::kUsage, "an image of the plot has pixels without a column or a colour"};
  std::vector<Colour> colours;
  for (const std::string& rgb : image.colours) colours.push_back(colour_of(rgb));
  // Stretches of one colour.
  for (std::size_t i = 0, end = 0; i < image.pixels.size(); i = end) {
    const std::size_t row = i / columns;
    for (end = i + 1; end < (row + 1) * columns && image.pixels[end] == image.pixels[i];) ++end;
    canvas.fill_box(image.left + static_cast<int>(i - row * columns), image.top + static_cast<int>(row),
                    static_cast<int>(end - i), 1, colours[image.pixels[i]]);
  }
  return {};
}

}  // namespace

Result<Buffer<std::byte>> plot_png(const Plot& plot) {
  if (std::min(plot.width, plot.height) < 1 || std::max(plot.width, plot.height) > kMaxPixels) {
    return Error{Fault::kUsage, fmt::format("a plot of {} x {} pixels cannot be drawn", plot.width, plot.height)};
  }
  Canvas canvas(plot.width, plot.height, {255, 255, 255});
  for (const Plot::Box& box : plot.boxes) {
    // Edges are rounded, not sizes, so that neighbours touch.
    const int left = rounded(box.left), top = rounded(box.top);
    canvas.fill_box(left, top, std::max(1, rounded(box.left + box.width) - left),
                    std::max(1, rounded(box.top + box.height) - top), colour_of(box.colour));
  }
  for (const Plot::Image& image : plot.images)
    if (Status status = put(canvas, image); !status) return status.error();
  for (const Plot::Line& line : plot.lines) {
    if (Status status = stroke(canvas, line.points, 1, 1, colour_of(line.colour)); !status) return status.error();
  }
  for (const Plot::Dot& dot : plot.dots) {
    const std::vector<std::array<double, 2>> position = {{dot.x - 0.01, dot.y}, {dot.x + 0.01, dot.y}};
    if (Status status = stroke(canvas, position, 2 * dot.radius, 0.5, colour_of(dot.colour)); !status) return status.error();
  }
  for (const Plot::Text& text : plot.texts) {
    const int width = text_width(text.line, text.size), x = rounded(text.x);
    const int left = text.anchor == Plot::Anchor::kEnd ? x - width : text.anchor == Plot::Anchor::kMiddle ? x - width / 2 : x;
    canvas.text(left, rounded(text.baseline), text.size, text.line, colour_of(text.colour));
  }
  return canvas.png();
}

}  // namespace lamina::view::picture
