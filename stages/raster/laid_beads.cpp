// Beads of a toolpath file, and the grid to look at them.
#include <algorithm>

#include "stages/raster/beads.h"

namespace lamina::raster {

void BeadRaster::add(std::span<const LaidBead> beads, Point2 origin) {
  const auto at = [&](Point2 p) { return Point2{p.x - origin.x, p.y - origin.y}; };
  for (const LaidBead& bead : beads) add(at(bead.from), at(bead.to), bead.width, BeadEnds::kRound);
}

PixelGrid bead_grid(const Box& box) {
  constexpr std::int64_t kMostDots = 508, kMostPixels = 20'000;  // an inch; along a side
  const std::int64_t longest = std::max<std::int64_t>({box.width(), box.depth(), 1});
  const std::int64_t dots = std::clamp<std::int64_t>(kMostPixels * kNmPerInch / longest, 1, kMostDots);
  return {PixelAxis(dots, std::max<std::int64_t>(box.width(), 1)), PixelAxis(dots, std::max<std::int64_t>(box.depth(), 1))};
}

}  // namespace lamina::raster
