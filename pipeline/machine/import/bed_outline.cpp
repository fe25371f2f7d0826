#include "pipeline/machine/import/bed_outline.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/job/errors.h"
#include "stages/support/text/number_text.h"

namespace lamina::pipeline {
namespace {

using OutlinePoint = std::array<double, 2>;

constexpr std::size_t kMaxOutlinePoints = 10'000;
constexpr double kNearOutline = 1e-6;  // mm

/// By the crossings of a ray.
bool is_within(const std::vector<OutlinePoint>& outline, double x, double y) {
  bool inside = false;
  for (std::size_t i = 0, j = outline.size() - 1; i < outline.size(); j = i++) {
    const auto& [ax, ay] = outline[i];
    const auto& [bx, by] = outline[j];
    if ((ay > y) != (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}

}  // namespace

Result<BedOutline> read_bed_outline(std::string_view text) {
  std::vector<OutlinePoint> outline;
  for (const std::string_view point : split(text, ",")) {
    const auto numbers = split(trimmed(point), "x");
    OutlinePoint& read = outline.emplace_back();
    if (numbers.size() != 2 || !read_number(trimmed(numbers[0]), -1e5, 1e5, "", read[0]).empty() ||
        !read_number(trimmed(numbers[1]), -1e5, 1e5, "", read[1]).empty() || outline.size() > kMaxOutlinePoints)
      return usage("is no list of points, as 0x0,220x0,220x220,0x220");
  }
  BedOutline bed;
  std::array<double, 2> end{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto [low, high] = std::ranges::minmax(outline, {}, [&](const OutlinePoint& p) { return p[axis]; });
    bed.corner_mm[axis] = low[axis];
    end[axis] = high[axis];
    bed.size_mm[axis] = high[axis] - low[axis];
  }
  const double x = bed.corner_mm[0], y = bed.corner_mm[1];
  if (outline.size() < 3 || !(bed.size_mm[0] > 0) || !(bed.size_mm[1] > 0)) return usage("has no area");
  const auto is_corner = [&](const OutlinePoint& p) { return (p[0] == x || p[0] == end[0]) && (p[1] == y || p[1] == end[1]); };
  bed.rectangular = outline.size() >= 4 && std::ranges::all_of(outline, is_corner);
  if (bed.rectangular) return bed;
  const std::array<double, 2> middle{(x + end[0]) / 2, (y + end[1]) / 2};
  double share = 0;
  for (double step = 0.5; step > kNearOutline; step /= 2) {
    const double a = bed.size_mm[0] / 2 * (share + step), b = bed.size_mm[1] / 2 * (share + step);
    bool within = true;
    for (const double side : {-1.0, 1.0}) {
      for (const double other : {-1.0, 1.0}) within = within && is_within(outline, middle[0] + side * a, middle[1] + other * b);
    }
    if (within) share += step;
  }
  if (!(share > 0)) return usage("is an outline that its middle is outside of");
  for (std::size_t axis = 0; axis < 2; ++axis) {
    bed.size_mm[axis] = std::floor(bed.size_mm[axis] * share * 10) / 10;
    bed.corner_mm[axis] = std::round((middle[axis] - bed.size_mm[axis] / 2) * 1e4) / 1e4;
  }
  return bed;
}

}  // namespace lamina::pipeline
