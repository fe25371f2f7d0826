#include "stages/infill/waves.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>
#include <vector>

#include "stages/data/clipping.h"

namespace lamina::infill {
namespace {

constexpr std::int64_t kMostLines = 1'000'000;
constexpr int kCosineSteps = 48;  // a period; off by less than 0.4 % of the wave's height

Nm side_length(const FillParameters& parameters) {
  return static_cast<Nm>(std::llround(parameters.cell / std::numbers::sqrt3));
}

/// One period of the wave from u = 0, without its end: offsets of u and v.
std::vector<Point2> period_of(const FillParameters& parameters) {
  const Nm a = side_length(parameters), height = wave_height(parameters);
  if (parameters.pattern == Pattern::kHoneycomb) return {{0, 0}, {a, 0}, {a + a / 2, height}, {2 * a + a / 2, height}};
  std::vector<Point2> points;
  for (int k = 0; k < kCosineSteps; ++k) {
    const double turn = 2 * std::numbers::pi * k / kCosineSteps;
    points.push_back({static_cast<Nm>(std::int64_t{3} * a * k / kCosineSteps),
                      static_cast<Nm>(std::llround(height * (1 - std::cos(turn)) / 2))});
  }
  return points;
}

}  // namespace

Nm wave_height(const FillParameters& parameters) {
  return static_cast<Nm>(std::llround(side_length(parameters) * std::numbers::sqrt3 / 2));
}

Status append_waves(const ContoursView& region, const FillParameters& parameters, Nm gap, std::int64_t side,
                    std::int64_t shift, std::int64_t start_u, const Frame& frame, Toolpaths& out) {
  if (region.size() == 0) return {};
  const Nm height = wave_height(parameters);
  const std::int64_t pitch = std::int64_t{height} + parameters.width + gap, length = std::int64_t{3} * side_length(parameters);
  if (parameters.pattern == Pattern::kQuatrefoil && gap <= 0) {
    return Error{Fault::kUsage, fmt::format("a quatrefoil's lines are kept apart; the gap is {} mm, give one above 0", mm(gap))};
  }
  Point2 lo = region.point.front(), hi = lo;
  for (const Point2 p : region.point) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
  }
  const std::int64_t origin = side + parameters.width / 2 + shift;
  const std::int64_t first = floor_div<std::int64_t>(lo.y - height - origin, pitch);
  const std::int64_t last = floor_div<std::int64_t>(hi.y - origin, pitch);
  if (last - first > kMostLines || (std::int64_t{hi.x} - lo.x) / length > kMostLines) {
    return Error{Fault::kUsage, fmt::format("cells of {} mm are too many; give larger ones", mm(parameters.cell))};
  }
  const std::vector<Point2> period = period_of(parameters);
  Contours waves;
  for (std::int64_t i = first; i <= last; ++i) {
    const std::int64_t v = origin + i * pitch;
    for (std::int64_t k = floor_div<std::int64_t>(lo.x - start_u, length) - 1; start_u + k * length <= hi.x; ++k) {
      for (const Point2 p : period) {
        const std::int64_t at_u = std::clamp<std::int64_t>(start_u + k * length + p.x, -kNmReach, kNmReach);
        const std::int64_t at_v = std::clamp<std::int64_t>(v + (i % 2 == 0 ? p.y : height - p.y), -kNmReach, kNmReach);
        waves.point.push_back({static_cast<Nm>(at_u), static_cast<Nm>(at_v)});
      }
    }
    waves.close();
  }
  auto pieces = clip_lines(waves, region);
  if (!pieces) return pieces.error();

  // Clipper gives pieces in any order and direction; waves run towards +u and lie in strips of their own.
  struct Piece {
    std::int64_t line;
    Nm u;
    std::uint32_t index;
    bool turned;
  };
  std::vector<Piece> order;
  for (std::uint32_t c = 0; c < pieces->size(); ++c) {
    const auto points = (*pieces)[c];
    const bool turned = points.front().x > points.back().x;
    const Nm u = std::min(points.front().x, points.back().x);
    // The middle of the piece is inside its strip whatever rounding did to its ends.
    const Point2 middle = points[points.size() / 2];
    const std::int64_t line = floor_div<std::int64_t>(middle.y - origin + (pitch - height) / 2, pitch);
    order.push_back({line, u, c, turned});
  }
  std::ranges::sort(order, [](const Piece& a, const Piece& b) {
    return std::tie(a.line, a.u, a.index) < std::tie(b.line, b.u, b.index);
  });
  for (std::size_t i = 0; i < order.size();) {
    // Pieces that meet end to end are one.
    Buffer<Point2> whole;
    std::size_t end = i;
    for (; end < order.size() && order[end].line == order[i].line; ++end) {
      const auto points = (*pieces)[order[end].index];
      Buffer<Point2> own(points.begin(), points.end());
      if (order[end].turned) std::reverse(own.begin(), own.end());
      if (!whole.empty() && whole.back() != own.front()) break;
      whole.insert(whole.end(), own.begin() + (whole.empty() ? 0 : 1), own.end());
    }
    const auto number = static_cast<std::int32_t>(order[i].line);
    if ((number % 2 != 0) != frame.reversed()) std::reverse(whole.begin(), whole.end());
    for (const Point2 p : whole) out.add(frame.from(p), PathKind::kRaster, parameters.width, number);
    out.close();
    i = end;
  }
  return {};
}

}  // namespace lamina::infill
