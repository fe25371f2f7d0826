#include "stages/infill/waves.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>
#include <vector>

#include "stages/geometry/clipping.h"

namespace lamina::infill {
namespace {

constexpr std::int64_t kMaxPeriods = 1'000'000;  // of a wave
constexpr int kCosineSteps = 48;                 // a period; off by less than 0.4 % of the wave's height

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

/// A piece of a wave that Clipper gave, in any order and direction.
struct WavePiece {
  std::size_t line;  // into places
  Nm u;
  std::uint32_t index;
  bool turned;
};

/// The wave in whose strip a piece lies, by the middle of the piece, which rounding left there.
std::size_t line_of(const LinePositions& positions, Nm height, std::span<const Point2> piece) {
  const Nm v = piece[piece.size() / 2].y;
  const auto above = std::upper_bound(positions.at.begin(), positions.at.end(), v);
  auto line = static_cast<std::size_t>(above - positions.at.begin());
  if (line == 0) return 0;
  // Between two strips: in the nearer one.
  if (above == positions.at.end() || v - (positions.at[line - 1] + height) <= *above - v) --line;
  return line;
}

void append_pieces(const Contours& pieces, const FillParameters& parameters, const LinePositions& positions, const Frame& frame,
                   Toolpaths& out) {
  std::vector<WavePiece> order;
  const Nm height = wave_height(parameters);
  for (std::uint32_t c = 0; c < pieces.size(); ++c) {
    const auto points = pieces[c];
    const bool turned = points.front().x > points.back().x;
    order.push_back({line_of(positions, height, points), std::min(points.front().x, points.back().x), c, turned});
  }
  std::ranges::sort(order, [](const WavePiece& a, const WavePiece& b) {
    return std::tie(a.line, a.u, a.index) < std::tie(b.line, b.u, b.index);
  });
  Buffer<Point2> whole, own;
  for (std::size_t i = 0; i < order.size();) {
    // Pieces that meet end to end are one.
    whole.clear();
    std::size_t end = i;
    for (; end < order.size() && order[end].line == order[i].line; ++end) {
      const auto points = pieces[order[end].index];
      own.assign(points.begin(), points.end());
      if (order[end].turned) std::reverse(own.begin(), own.end());
      if (!whole.empty() && whole.back() != own.front()) break;
      whole.insert(whole.end(), own.begin() + (whole.empty() ? 0 : 1), own.end());
    }
    const std::int32_t number = positions.first_number + static_cast<std::int32_t>(order[i].line);
    i = end;
    if (std::int64_t{whole.back().x} - whole.front().x < parameters.shortest_line) continue;
    if ((number % 2 != 0) != frame.reversed()) std::reverse(whole.begin(), whole.end());
    for (const Point2 p : whole) out.add(frame.from(p), PathKind::kRaster, parameters.width, number);
    out.close();
  }
}

}  // namespace

Nm wave_height(const FillParameters& parameters) {
  return static_cast<Nm>(std::llround(side_length(parameters) * std::numbers::sqrt3 / 2));
}

std::uint64_t wave_batch(std::size_t region_points) { return std::max<std::uint64_t>(4096, region_points); }

std::uint64_t wave_points(const FillParameters& parameters, std::int64_t length) {
  const std::uint64_t of_period = parameters.pattern == Pattern::kHoneycomb ? 4 : kCosineSteps;
  return (static_cast<std::uint64_t>(length / (std::int64_t{3} * side_length(parameters))) + 3) * of_period;
}

WaveBound bound_waves(const ContoursView& region, const FillParameters& parameters, const LinePositions& positions) {
  const Nm a = side_length(parameters), height = wave_height(parameters);
  const std::int64_t period = std::int64_t{3} * a;
  const bool straight = parameters.pattern == Pattern::kHoneycomb;
  const std::int64_t of_period = straight ? 4 : kCosineSteps;
  const std::int64_t nearest = std::max<std::int64_t>(1, straight ? a / 2 : period / kCosineSteps);  // corner to corner
  const auto corners = [&](std::int64_t length) {
    return static_cast<std::uint64_t>(length / period * of_period + std::min(of_period, length % period / nearest + 1));
  };
  struct Reach {
    std::int64_t low = INT64_MAX, high = INT64_MIN;
  };
  std::vector<Reach> reach(positions.at.size());
  std::uint64_t crossings = 0;
  for (std::uint32_t c = 0; c < region.size(); ++c) {
    Point2 p = region[c].back();
    for (const Point2 q : region[c]) {
      const Point2 low = p.y <= q.y ? p : q, high = p.y <= q.y ? q : p;
      p = q;
      const auto begin_of_strips = positions.at.begin();
      const auto first =
          std::lower_bound(begin_of_strips, positions.at.end(), std::int64_t{low.y} - height - 1) - begin_of_strips;
      const auto last = std::upper_bound(begin_of_strips, positions.at.end(), std::int64_t{high.y} + 1) - begin_of_strips;
      const auto u_at = [&](std::int64_t v) {
        if (v <= low.y || low.y == high.y) return static_cast<double>(low.x);
        if (v >= high.y) return static_cast<double>(high.x);
        const double share = static_cast<double>(v - low.y) / static_cast<double>(std::int64_t{high.y} - low.y);
        return low.x + (static_cast<double>(high.x) - low.x) * share;
      };
      for (auto i = first; i < last; ++i) {
        double from = u_at(positions.at[i] - 1), to = u_at(positions.at[i] + height + 1);
        if (low.y == high.y) from = low.x, to = high.x;
        if (from > to) std::swap(from, to);
        const auto begin = static_cast<std::int64_t>(std::floor(from)) - 2, end = static_cast<std::int64_t>(std::ceil(to)) + 2;
        reach[i].low = std::min(reach[i].low, begin);
        reach[i].high = std::max(reach[i].high, end);
        crossings += corners(end - begin) + 1;
      }
    }
  }
  WaveBound bound;
  bound.points = 2 * crossings;  // both ends of what an edge shares with a wave
  bound.pieces = crossings + 1;
  for (const Reach& own : reach) {
    // Clipper divides open lines where they turn back; the ends are joined again unless they lie between others.
    if (own.low <= own.high)
      bound.points += corners(own.high - own.low) + 2 * static_cast<std::uint64_t>((own.high - own.low) / period + 2);
  }
  return bound;
}

Status append_waves(const ContoursView& region, const FillParameters& parameters, const LinePositions& positions,
                    std::int64_t start_u, const Frame& frame, Toolpaths& out) {
  if (region.size() == 0 || positions.at.empty()) return {};
  const Nm height = wave_height(parameters);
  const std::int64_t length = std::int64_t{3} * side_length(parameters);
  Nm low = region.point.front().x, high = low;
  for (const Point2 p : region.point) low = std::min(low, p.x), high = std::max(high, p.x);
  if ((std::int64_t{high} - low) / length > kMaxPeriods) {
    return Error{Fault::kUsage, fmt::format("cells of {} mm are too many; give larger ones", mm(parameters.cell))};
  }
  const std::vector<Point2> period = period_of(parameters);
  Contours waves;
  for (std::size_t i = 0; i < positions.at.size(); ++i) {
    const bool mirrored = (positions.first_number + static_cast<std::int64_t>(i)) % 2 != 0;
    for (std::int64_t k = floor_div<std::int64_t>(low - start_u, length) - 1; start_u + k * length <= high; ++k) {
      for (const Point2 p : period) {
        const std::int64_t at_u = std::clamp<std::int64_t>(start_u + k * length + p.x, -kNmReach, kNmReach);
        const std::int64_t at_v =
            std::clamp<std::int64_t>(positions.at[i] + (mirrored ? height - p.y : p.y), -kNmReach, kNmReach);
        waves.point.push_back({static_cast<Nm>(at_u), static_cast<Nm>(at_v)});
      }
    }
    waves.close();
    if (waves.point.size() < wave_batch(region.point.size()) && i + 1 < positions.at.size()) continue;
    const auto pieces = clip_lines(waves, region);
    if (!pieces) return pieces.error();
    append_pieces(*pieces, parameters, positions, frame, out);
    waves.clear();
  }
  return {};
}

}  // namespace lamina::infill
