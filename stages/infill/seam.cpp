#include "stages/infill/seam.h"

#include <cmath>
#include <tuple>

namespace lamina::infill {
namespace {

/// How well a point hides a seam: 2 at a corner into the part, 1 at one out of it, else 0.
int corner_rank(Point2 before, Point2 at, Point2 after) {
  constexpr double kCosine = 0.8660254037844387;  // of 30 degrees
  const double ux = static_cast<double>(at.x) - before.x, uy = static_cast<double>(at.y) - before.y;
  const double vx = static_cast<double>(after.x) - at.x, vy = static_cast<double>(after.y) - at.y;
  const double along = ux * vx + uy * vy, across = ux * vy - uy * vx;
  if (along > kCosine * std::hypot(ux, uy) * std::hypot(vx, vy)) return 0;
  return across < 0 ? 2 : 1;
}

}  // namespace

std::size_t seam_point(std::span<const Point2> contour, Seam seam, Point2 from) {
  const std::size_t size = contour.size();
  if (seam == Seam::kContour) return 0;
  const auto key = [&](std::size_t i) {
    const Point2 p = contour[i];
    if (seam == Seam::kNearest) {
      const double dx = static_cast<double>(p.x) - from.x, dy = static_cast<double>(p.y) - from.y;
      return std::tuple(0, -(dx * dx + dy * dy), 0.0);
    }
    const int rank = seam == Seam::kAligned ? corner_rank(contour[(i + size - 1) % size], p, contour[(i + 1) % size]) : 0;
    return std::tuple(rank, static_cast<double>(p.y), static_cast<double>(p.x));
  };
  std::size_t best = 0;
  auto best_key = key(0);
  for (std::size_t i = 1; i < size; ++i) {
    if (const auto other = key(i); other > best_key) {
      best = i;
      best_key = other;
    }
  }
  return best;
}

}  // namespace lamina::infill
