#include "stages/view/picture/contour_shares.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina::view::picture {
namespace {

constexpr int kSubrows = 8;

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

}  // namespace

std::vector<std::uint8_t> contour_shares(const ContoursView& contours, const Scale& scale, int width, int height) {
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

}  // namespace lamina::view::picture
