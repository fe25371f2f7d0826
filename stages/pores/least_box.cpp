#include "stages/pores/least_box.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace lamina::pores {
namespace {

using Wide = __int128;

/// Twice the area of the triangle, in pixels.
std::int64_t turn(Pixel a, Pixel b, Pixel c) {
  return (std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - a.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - a.x);
}

// Andrew's chains: the lower one grows in front, the upper one is found backwards behind it.
std::size_t hull_of(std::span<Pixel> pixels) {
  std::ranges::sort(pixels, {}, [](Pixel p) { return std::pair(p.y, p.x); });
  const std::size_t count = static_cast<std::size_t>(std::unique(pixels.begin(), pixels.end()) - pixels.begin());
  if (count < 3) return count;
  const Pixel first = pixels[0], last = pixels[count - 1];
  // Points right of the line between the ends go to the one chain, others to the other; both stay in order.
  const auto right = std::stable_partition(pixels.begin() + 1, pixels.begin() + static_cast<std::ptrdiff_t>(count) - 1,
                                           [&](Pixel p) { return turn(first, last, p) < 0; });
  const auto middle = static_cast<std::size_t>(right - pixels.begin());
  std::size_t size = 1;
  const auto push = [&](Pixel p, std::size_t least) {
    while (size > least && turn(pixels[size - 2], pixels[size - 1], p) <= 0) --size;
    pixels[size++] = p;
  };
  for (std::size_t i = 1; i < middle; ++i) push(pixels[i], 1);
  // The last one takes a place of its own only where the chain left one; else that of a pixel that is moved behind it.
  std::rotate(pixels.begin() + static_cast<std::ptrdiff_t>(middle), pixels.begin() + static_cast<std::ptrdiff_t>(count) - 1,
              pixels.begin() + static_cast<std::ptrdiff_t>(count));
  push(last, 1);
  const std::size_t turned = size;
  std::reverse(pixels.begin() + static_cast<std::ptrdiff_t>(middle) + 1, pixels.begin() + static_cast<std::ptrdiff_t>(count));
  for (std::size_t i = middle + 1; i < count; ++i) push(pixels[i], turned);
  while (size > turned && turn(pixels[size - 2], pixels[size - 1], first) <= 0) --size;
  return size;
}

/// Extents along a direction in nm and across it, each times its length.
std::array<double, 2> extents(std::span<const Pixel> hull, std::array<Nm, 2> edge, Wide dx, Wide dy) {
  Wide low = 0, high = 0, left = 0, right = 0;
  for (const Pixel& p : hull) {
    const Wide x = Wide{p.x - std::int64_t{hull[0].x}} * edge[0], y = Wide{p.y - std::int64_t{hull[0].y}} * edge[1];
    const Wide along = x * dx + y * dy, across = y * dx - x * dy;
    low = std::min(low, along), high = std::max(high, along);
    left = std::min(left, across), right = std::max(right, across);
  }
  const Wide ax = dx < 0 ? -dx : dx, ay = dy < 0 ? -dy : dy;
  return {static_cast<double>(high - low + std::max(ax * edge[0], ay * edge[1])),
          static_cast<double>(right - left + std::max(ay * edge[0], ax * edge[1]))};
}

}  // namespace

BoxSides least_box(std::span<Pixel> pixels, std::array<Nm, 2> edge) {
  const std::span<const Pixel> hull = pixels.first(hull_of(pixels));
  std::tuple<double, double, double> best;  // area, width, length
  const auto attempt = [&](Wide dx, Wide dy, bool first) {
    const auto [along, across] = extents(hull, edge, dx, dy);
    const auto squared = static_cast<double>(dx * dx + dy * dy);
    const double unit = std::sqrt(squared);
    const std::tuple box(along * across / squared, std::min(along, across) / unit, std::max(along, across) / unit);
    if (first || box < best) best = box;
  };
  attempt(1, 0, true);
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Pixel from = hull[i], to = hull[(i + 1) % hull.size()];
    const Wide dx = Wide{to.x - std::int64_t{from.x}} * edge[0], dy = Wide{to.y - std::int64_t{from.y}} * edge[1];
    if (dx != 0 && dy != 0) attempt(dx, dy, false);
  }
  return {std::get<2>(best), std::get<1>(best)};
}

}  // namespace lamina::pores
