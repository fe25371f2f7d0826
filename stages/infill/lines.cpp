#include "stages/infill/lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/geometry/clipping.h"

namespace lamina::infill {
namespace {

constexpr std::uint32_t kNone = UINT32_MAX;

/// Where a line crosses an edge. The edge runs from point `edge` to the next one of its contour.
struct Crossing {
  double u;  // for ordering; off by less than 2^-20 nm
  std::uint32_t edge;
  bool enters;  // going towards +u
};

/// A stretch of a line inside the region.
struct LineInterval {
  Nm begin, end;                       // u, nm, begin < end
  std::uint32_t begin_edge, end_edge;  // that they lie on
  bool deposited = false;
};

class Scan {
 public:
  Scan(const ContoursView& region, const LinePositions& positions) : point_(region.point), at_(positions.at) {
    next_.resize(point_.size());
    previous_.resize(point_.size());
    for (std::uint32_t c = 0; c < region.size(); ++c) {
      const std::uint32_t begin = region.offset[c], end = region.offset[c + 1];
      for (std::uint32_t i = begin; i < end; ++i) {
        next_[i] = i + 1 == end ? begin : i + 1;
        previous_[next_[i]] = i;
      }
    }
    find_lines(region);
    find_crossings();
    find_intervals();
  }

  std::uint32_t lines() const { return static_cast<std::uint32_t>(at_.size()); }
  std::uint32_t begin_of(std::uint32_t line) const { return offset_[line]; }
  std::uint32_t end_of(std::uint32_t line) const { return offset_[line + 1]; }
  LineInterval& interval(std::uint32_t i) { return intervals_[i]; }

  /// Walks from the crossing of `line` with `edge` along the contour towards the next line. Returns the stretch of
  /// that line which begins (or ends) where the walk arrives, and the contour's points on the way; kNone if there is
  /// none, or if it is longer than `longest`.
  std::uint32_t walk(std::uint32_t line, std::uint32_t edge, bool at_end, Point2 from, std::int64_t longest,
                     Buffer<Point2>& way) {
    way.clear();
    if (line + 1 >= lines()) return kNone;
    const std::int64_t here = at_[line], there = at_[line + 1];
    double length = 0;
    Point2 last = from;
    // The end of a stretch lies on an edge that goes up, its begin on one that goes down: that one is walked back.
    for (std::uint32_t e = edge;;) {
      const std::uint32_t ahead = at_end ? next_[e] : e;  // the point that is walked to
      const Point2 p = point_[ahead];
      if (p.y > there) {  // crosses the next line
        const std::uint32_t found = interval_at(line + 1, e, at_end);
        if (found == kNone) return kNone;
        const Nm u = at_end ? intervals_[found].end : intervals_[found].begin;
        length += std::hypot(static_cast<double>(u) - last.x, static_cast<double>(there) - last.y);
        return length <= static_cast<double>(longest) ? found : kNone;
      }
      if (p.y <= here) return kNone;
      length += std::hypot(static_cast<double>(p.x) - last.x, static_cast<double>(p.y) - last.y);
      if (length > static_cast<double>(longest)) return kNone;
      if (p != last) way.push_back(p);
      last = p;
      e = at_end ? next_[e] : previous_[e];
    }
  }

  /// Walks from the crossing of `line` with `edge` along the contour, upwards or downwards, as far as it leaves the line where
  /// it comes back before it meets a neighbouring one: to the corner that no line reaches. `way` is empty if it meets one.
  void walk_to_corner(std::uint32_t line, std::uint32_t edge, bool at_end, bool upwards, Buffer<Point2>& way) const {
    way.clear();
    const bool forwards = at_end == upwards;
    const std::int64_t here = at_[line];
    std::int64_t limit = upwards ? INT64_MAX : INT64_MIN, furthest = here;
    if (upwards && line + 1 < lines()) limit = at_[line + 1];
    if (!upwards && line > 0) limit = at_[line - 1];
    std::size_t corner = 0;
    for (std::uint32_t e = edge;; e = forwards ? next_[e] : previous_[e]) {
      const Point2 p = point_[forwards ? next_[e] : e];
      if (upwards ? p.y > limit : p.y <= limit) {
        if (interval_at(upwards ? line + 1 : line - 1, e, at_end) != kNone) return way.clear();
        limit = upwards ? INT64_MAX : INT64_MIN;  // it only touches the corner
      }
      if (upwards ? p.y <= here : p.y > here) break;
      way.push_back(p);
      if (upwards ? p.y <= furthest : p.y >= furthest) continue;
      furthest = p.y;
      corner = way.size();
    }
    way.resize(corner);
  }

 private:
  /// Of each point, the first line at or above it. Between neighbours of a contour are the lines that their edge crosses.
  void find_lines(const ContoursView& region) {
    above_.resize(point_.size());
    for (std::uint32_t c = 0; c < region.size(); ++c) {
      const std::uint32_t begin = region.offset[c], end = region.offset[c + 1];
      if (begin == end) continue;
      auto line = static_cast<std::uint32_t>(std::ranges::lower_bound(at_, std::int64_t{point_[begin].y}) - at_.begin());
      for (std::uint32_t i = begin; i < end; ++i) {
        while (line < at_.size() && at_[line] < point_[i].y) ++line;
        while (line > 0 && at_[line - 1] >= point_[i].y) --line;
        above_[i] = line;
      }
    }
  }

  /// count, scan, fill
  void find_crossings() {
    const auto for_each = [&](auto&& act) {
      for (std::uint32_t e = 0; e < point_.size(); ++e) {
        // A line at v is crossed if low <= v < high: an end on the line is below it.
        const auto [first, last] = std::minmax(above_[e], above_[next_[e]]);
        for (std::uint32_t line = first; line < last; ++line) act(line, e, point_[e], point_[next_[e]]);
      }
    };
    crossing_offset_.assign(at_.size() + 1, 0);
    for_each([&](std::uint32_t line, std::uint32_t, Point2, Point2) { ++crossing_offset_[line]; });
    std::uint32_t total = 0;
    for (std::uint32_t& offset : crossing_offset_) total += std::exchange(offset, total);
    crossing_.resize(total);
    Buffer<std::uint32_t> position(crossing_offset_.begin(), crossing_offset_.end());
    for_each([&](std::uint32_t line, std::uint32_t e, Point2 a, Point2 b) {
      const double share = static_cast<double>(at_[line] - a.y) / static_cast<double>(std::int64_t{b.y} - a.y);
      const double u = a.x + share * static_cast<double>(std::int64_t{b.x} - a.x);
      crossing_[position[line]++] = {u, e, b.y < a.y};
    });
    for (std::uint32_t line = 0; line < at_.size(); ++line) {
      std::sort(crossing_.begin() + crossing_offset_[line], crossing_.begin() + crossing_offset_[line + 1],
                [&](const Crossing& a, const Crossing& b) { return is_before(a, b, at_[line]); });
    }
  }

  /// Crossing of an edge with a line as a fraction: numerator / denominator, denominator > 0.
  std::pair<__int128, std::int64_t> exact(std::uint32_t e, std::int64_t v) const {
    const Point2 a = point_[e], b = point_[next_[e]];
    std::int64_t denominator = std::int64_t{b.y} - a.y;
    __int128 numerator = static_cast<__int128>(std::int64_t{b.x} - a.x) * (v - a.y) + static_cast<__int128>(a.x) * denominator;
    if (denominator < 0) {
      denominator = -denominator;
      numerator = -numerator;
    }
    return {numerator, denominator};
  }

  bool is_before(const Crossing& a, const Crossing& b, std::int64_t v) const {
    if (std::abs(a.u - b.u) > 1e-3) [[likely]]
      return a.u < b.u;
    const auto [na, da] = exact(a.edge, v);
    const auto [nb, db] = exact(b.edge, v);
    const __int128 left = na * db, right = nb * da;  // below 2^97
    if (left != right) return left < right;
    // Where the region touches itself the segment continues.
    if (a.enters != b.enters) return a.enters;
    return a.edge < b.edge;
  }

  /// The line's crossing rounded into the region.
  Nm end_inside(const Crossing& crossing, std::int64_t v) const {
    const auto [numerator, denominator] = exact(crossing.edge, v);
    const __int128 d = denominator;
    return static_cast<Nm>(crossing.enters ? ceil_div<__int128>(numerator, d) : floor_div<__int128>(numerator, d));
  }

  void find_intervals() {
    offset_.assign(1, 0);
    for (std::uint32_t line = 0; line < at_.size(); ++line) {
      std::int32_t winding = 0;
      Crossing begin{};
      for (std::uint32_t i = crossing_offset_[line]; i < crossing_offset_[line + 1]; ++i) {
        const Crossing& crossing = crossing_[i];
        if (winding == 0) begin = crossing;
        winding += crossing.enters ? 1 : -1;
        if (winding != 0) continue;
        const Nm from = end_inside(begin, at_[line]), to = end_inside(crossing, at_[line]);
        if (from < to) intervals_.push_back({from, to, begin.edge, crossing.edge});
      }
      offset_.push_back(static_cast<std::uint32_t>(intervals_.size()));
    }
  }

  std::uint32_t interval_at(std::uint32_t line, std::uint32_t edge, bool at_end) const {
    for (std::uint32_t i = offset_[line]; i < offset_[line + 1]; ++i) {
      if ((at_end ? intervals_[i].end_edge : intervals_[i].begin_edge) == edge) return i;
    }
    return kNone;
  }

  std::span<const Point2> point_;
  const Buffer<std::int64_t>& at_;
  Buffer<std::uint32_t> next_, previous_, above_;
  Buffer<std::uint32_t> crossing_offset_;
  Buffer<Crossing> crossing_;
  Buffer<std::uint32_t> offset_;  // lines + 1, into intervals_
  Buffer<LineInterval> intervals_;
};

constexpr std::int64_t kMaxPeriods = 1'000'000;  // of a wave
constexpr int kCosineSteps = 48;                 // a period; off by less than 0.4 % of the wave's height

Nm side_length(const FillParameters& parameters) {
  return static_cast<Nm>(std::llround(parameters.cell / std::numbers::sqrt3));
}

/// Points of the waves that are clipped together in a region of so many points.
std::uint64_t wave_batch(std::size_t region_points) { return std::max<std::uint64_t>(4096, region_points); }

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
  std::size_t line;  // into positions
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

std::uint64_t count_crossings(const ContoursView& region, const LinePositions& positions) {
  const auto line_at = [&](std::int64_t v) {
    return std::lower_bound(positions.at.begin(), positions.at.end(), v) - positions.at.begin();
  };
  std::uint64_t total = 0;
  for (std::uint32_t c = 0; c < region.size(); ++c) {
    std::int64_t before = line_at(region[c].back().y);
    for (const Point2 p : region[c]) {
      const std::int64_t at = line_at(p.y);
      total += static_cast<std::uint64_t>(std::abs(at - before));
      before = at;
    }
  }
  return total;
}

void append_raster(const ContoursView& region, const FillParameters& parameters, const LinePositions& positions,
                   const Frame& frame, Toolpaths& out) {
  if (region.size() == 0 || positions.at.empty()) return;
  std::int64_t longest_link = parameters.longest_link;
  if (longest_link < 0) {
    std::int64_t widest = 0;
    for (std::size_t i = 1; i < positions.at.size(); ++i) widest = std::max(widest, positions.at[i] - positions.at[i - 1]);
    longest_link = 3 * widest;
  }
  Scan scan(region, positions);
  Buffer<Point2> way;
  for (std::uint32_t first = 0; first < scan.lines(); ++first) {
    for (std::uint32_t start = scan.begin_of(first); start < scan.end_of(first); ++start) {
      if (scan.interval(start).deposited) continue;
      std::uint32_t line = first, current = start;
      const std::size_t points_before = out.point.size();
      for (;;) {
        LineInterval& interval = scan.interval(current);
        interval.deposited = true;
        if (std::int64_t{interval.end} - interval.begin < parameters.shortest_line) break;
        const std::int32_t number = positions.first_number + static_cast<std::int32_t>(line);
        const bool forwards = (number % 2 == 0) != frame.reversed();
        const auto v = static_cast<Nm>(positions.at[line]);
        const Point2 from{forwards ? interval.begin : interval.end, v}, to{forwards ? interval.end : interval.begin, v};
        const std::uint32_t from_edge = forwards ? interval.begin_edge : interval.end_edge,
                            to_edge = forwards ? interval.end_edge : interval.begin_edge;
        if (parameters.fills_corners && line == first) {
          scan.walk_to_corner(line, from_edge, !forwards, false, way);
          for (std::size_t i = way.size(); i-- > 0;) out.add(frame.from(way[i]), PathKind::kLink, parameters.width);
        }
        out.add(frame.from(from), PathKind::kRaster, parameters.width, number);
        const std::uint32_t found = scan.walk(line, to_edge, forwards, to, longest_link, way);
        const bool links = found != kNone && !scan.interval(found).deposited &&
                           std::int64_t{scan.interval(found).end} - scan.interval(found).begin >= parameters.shortest_line;
        if (!links) {
          way.clear();
          if (parameters.fills_corners) scan.walk_to_corner(line, to_edge, forwards, true, way);
          const bool ends = way.empty();
          out.add(frame.from(to), ends ? PathKind::kRaster : PathKind::kLink, parameters.width, ends ? number : kNoLine);
          for (const Point2 p : way) out.add(frame.from(p), PathKind::kLink, parameters.width);
          break;
        }
        out.add(frame.from(to), PathKind::kLink, parameters.width);
        for (const Point2 p : way) out.add(frame.from(p), PathKind::kLink, parameters.width);
        current = found;
        ++line;
      }
      if (out.point.size() > points_before) out.close();
    }
  }
}

// Waves.

Nm wave_height(const FillParameters& parameters) {
  return static_cast<Nm>(std::llround(side_length(parameters) * std::numbers::sqrt3 / 2));
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
  const auto [low, high] = std::ranges::minmax(region.point, {}, &Point2::x);
  const auto of_wave = static_cast<std::uint64_t>(((std::int64_t{high.x} - low.x) / period + 3) * of_period);
  bound.at_once = std::min(positions.at.size() * of_wave, of_wave + wave_batch(region.point.size()));
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
