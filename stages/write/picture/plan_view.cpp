#include "stages/write/picture/plan_view.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina::write::picture {
namespace {

constexpr int kSubrows = 8;
constexpr Colour kGround{255, 255, 255}, kPaper{244, 244, 246}, kSolid{205, 209, 216}, kText{40, 44, 52};

/// Pixels of the picture's panel: x from its left, y from its top.
struct Scale {
  double left, top, pixels_per_nm;
  double x(Nm at) const { return (at - left) * pixels_per_nm; }
  double y(Nm at) const { return (top - at) * pixels_per_nm; }
};

/// Adds to `share` how much of each pixel of a row of pixels [from, to) covers, times `weight`.
void add_span(double from, double to, double weight, std::vector<double>& share) {
  from = std::clamp(from, 0.0, static_cast<double>(share.size()));
  to = std::clamp(to, 0.0, static_cast<double>(share.size()));
  if (from >= to) return;
  const auto first = static_cast<std::size_t>(from), last = std::min(static_cast<std::size_t>(to), share.size() - 1);
  if (first == last) {
    share[first] += (to - from) * weight;
    return;
  }
  share[first] += (static_cast<double>(first) + 1 - from) * weight;
  for (std::size_t i = first + 1; i < last; ++i) share[i] += weight;
  share[last] += (to - static_cast<double>(last)) * weight;
}

/// Shares of 0 .. 255 of a panel of width x height pixels that lie within contours, by the nonzero rule.
std::vector<std::uint8_t> coverage(const ContoursView& contours, const Scale& scale, int width, int height) {
  struct Crossing {
    float x;
    int turn;
  };
  std::vector<std::vector<Crossing>> crossings(static_cast<std::size_t>(height) * kSubrows);
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 a = contours[c].back();
    for (const Point2 b : contours[c]) {
      double ax = scale.x(a.x), ay = scale.y(a.y), bx = scale.x(b.x), by = scale.y(b.y);
      const int turn = ay < by ? 1 : -1;
      a = b;
      if (ay > by) std::swap(ax, bx), std::swap(ay, by);
      const auto row = [&](double y) {
        return static_cast<long>(std::clamp(std::ceil(y * kSubrows - 0.5), 0.0, static_cast<double>(crossings.size())));
      };
      for (long r = row(ay); r < row(by); ++r) {
        const double y = (static_cast<double>(r) + 0.5) / kSubrows;
        crossings[static_cast<std::size_t>(r)].push_back({static_cast<float>(ax + (bx - ax) * (y - ay) / (by - ay)), turn});
      }
    }
  }
  std::vector<std::uint8_t> shares(static_cast<std::size_t>(width) * height);
  std::vector<double> share;
  for (int y = 0; y < height; ++y) {
    share.assign(static_cast<std::size_t>(width), 0);
    for (int s = 0; s < kSubrows; ++s) {
      auto& row = crossings[static_cast<std::size_t>(y) * kSubrows + s];
      std::ranges::sort(row, {}, &Crossing::x);
      int winding = 0;
      double begin = 0;
      for (const Crossing& crossing : row) {
        if (winding == 0) begin = crossing.x;
        winding += crossing.turn;
        if (winding == 0) add_span(begin, crossing.x, 1.0 / kSubrows, share);
      }
    }
    for (int x = 0; x < width; ++x) {
      shares[static_cast<std::size_t>(y) * width + x] =
          static_cast<std::uint8_t>(std::clamp(share[static_cast<std::size_t>(x)] * 255 + 0.5, 0.0, 255.0));
    }
  }
  return shares;
}

}  // namespace

Result<Buffer<std::byte>> plan_view(const PlanView& view) {
  const int width = static_cast<int>(view.width), size = std::clamp(width / 60, 14, 48), margin = size;
  const double shown = static_cast<double>(std::max<std::int64_t>(view.box.width(), 1000));
  const double tall = static_cast<double>(std::max<std::int64_t>(view.box.depth(), 1000));
  const double pixels_per_nm = std::min((width - 2 * margin) / (shown * 1.04), 4.0 * width / (tall * 1.04));
  const int height = std::max(1, static_cast<int>(std::ceil(tall * 1.04 * pixels_per_nm)));
  const int head = have_font() ? 3 * size + size / 2 : margin, panel = width - 2 * margin;
  const double middle = (static_cast<double>(view.box.lo.x) + view.box.hi.x) / 2;
  const Scale scale{middle - panel / pixels_per_nm / 2, view.box.hi.y + tall * 0.02, pixels_per_nm};

  Canvas canvas(width, head + height + margin, kGround);
  canvas.fill_box(margin, head, panel, height, kPaper);
  canvas.paint(margin, head, panel, coverage(view.region, scale, panel, height), kSolid);
  for (const PlanView::Shape& shape : view.shapes) {
    canvas.paint(margin, head, panel, coverage(shape.outline, scale, panel, height), shape.ink);
  }
  canvas.text(margin, size + size / 2, size, view.title, kText);
  int left = margin;
  const int small = size * 3 / 4, line = 2 * size + size / 2 + size / 4;
  canvas.text(left, line, small, view.caption, kText);
  left += text_width(view.caption, small) + size;
  for (const PlanView::Shape& shape : view.shapes) {
    if (!have_font()) break;
    canvas.fill_box(left, line - small * 3 / 4, small * 3 / 4, small * 3 / 4, shape.ink);
    canvas.text(left + small, line, small, shape.name, kText);
    left += small + text_width(shape.name, small) + size;
  }
  return canvas.png();
}

}  // namespace lamina::write::picture
