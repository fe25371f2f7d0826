#include "stages/infill/gaps.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "stages/geometry/bead_section.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/components.h"

namespace lamina::infill {
namespace {

constexpr double kNarrower = 5.0 / 6;            // half widths at most so far apart
constexpr std::int64_t kLineTolerance = 5'000;   // nm by which a line may cut its corners
constexpr std::int64_t kShortestLine = 200'000;  // nm: a line that is shorter is the end of a bead of its own

/// Calls use(begin, end, area) for each outer contour with its holes. area  nm2
template <class Use>
void for_each_island(const ContoursView& region, Use use) {
  for_each_component(region, [&](std::uint32_t begin, std::uint32_t end) {
    double area = 0;
    for (std::uint32_t c = begin; c < end; ++c) area += square_mm(doubled_area(region[c]));
    use(begin, end, area * 1e12);
  });
}

struct IslandBox {
  Point2 lo, hi;
  explicit IslandBox(std::span<const Point2> outer) : lo(outer.front()), hi(outer.front()) {
    for (const Point2 p : outer) {
      lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
      hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
    }
  }
  bool contains(Point2 p) const { return p.x >= lo.x && p.x <= hi.x && p.y >= lo.y && p.y <= hi.y; }
};

void append_range(const ContoursView& from, std::uint32_t first, std::uint32_t end, Contours& to) {
  for (std::uint32_t c = first; c < end; ++c) {
    to.point.insert(to.point.end(), from[c].begin(), from[c].end());
    to.close();
  }
}

/// Points by square cells, for searches in boxes of a few cells.
class PointCells {
 public:
  PointCells(std::initializer_list<const Contours*> lines, Nm cell) : cell_(cell) {
    for (const Contours* each : lines) {
      for (const Point2 p : each->point)
        cells_[key(floor_div<std::int64_t>(p.x, cell), floor_div<std::int64_t>(p.y, cell))].push_back(p);
    }
  }
  bool any_in(const IslandBox& box) const {
    for (std::int64_t i = floor_div<std::int64_t>(box.lo.x, cell_); i <= floor_div<std::int64_t>(box.hi.x, cell_); ++i) {
      for (std::int64_t j = floor_div<std::int64_t>(box.lo.y, cell_); j <= floor_div<std::int64_t>(box.hi.y, cell_); ++j) {
        const auto found = cells_.find(key(i, j));
        if (found != cells_.end() && std::ranges::any_of(found->second, [&](Point2 p) { return box.contains(p); })) return true;
      }
    }
    return false;
  }

 private:
  static std::uint64_t key(std::int64_t i, std::int64_t j) {
    return std::uint64_t{static_cast<std::uint32_t>(i)} << 32 | static_cast<std::uint32_t>(j);
  }
  std::int64_t cell_;
  std::unordered_map<std::uint64_t, std::vector<Point2>> cells_;
};

/// Numbered points by square cells as wide as the reach of a search.
class PointGrid {
 public:
  explicit PointGrid(std::int64_t reach) : reach_(reach) {}
  void add(Point2 at, std::uint32_t number) { cells_[cell_of(at, 0, 0)].push_back({at, number}); }
  /// Calls use(point, number) for all points within reach until it returns true. returns  whether it did
  template <class Use>
  bool any_near(Point2 at, Use use) const {
    for (std::int64_t i = -1; i <= 1; ++i) {
      for (std::int64_t j = -1; j <= 1; ++j) {
        const auto cell = cells_.find(cell_of(at, i, j));
        if (cell == cells_.end()) continue;
        for (const auto& [point, number] : cell->second) {
          if (distance(point, at) <= static_cast<double>(reach_) && use(point, number)) return true;
        }
      }
    }
    return false;
  }

 private:
  std::uint64_t cell_of(Point2 at, std::int64_t i, std::int64_t j) const {
    const auto x = static_cast<std::uint32_t>(floor_div<std::int64_t>(at.x, reach_) + i);
    const auto y = static_cast<std::uint32_t>(floor_div<std::int64_t>(at.y, reach_) + j);
    return std::uint64_t{x} << 32 | y;
  }
  struct NumberedPoint {
    Point2 at;
    std::uint32_t number;
  };
  std::int64_t reach_;
  std::unordered_map<std::uint64_t, std::vector<NumberedPoint>> cells_;
};

/// A line along the middle of a strip.
struct CentreLine {
  std::vector<Point2> point;
  Nm gap;
  double length = 0;
};

constexpr double kRounding = 4;     // nm, of points that an offset moves
constexpr double kFinest = 15'000;  // nm, of the difference of two half widths: nozzles are no finer

/// Half widths, from the widest to the narrowest: a sixth less each.
std::vector<double> half_widths(const GapWidths& widths) {
  const double narrowest = widths.minimum / 2.0;
  std::vector<double> half{widths.maximum / 2.0};
  while (half.back() > narrowest) {
    const double next = half.back() - std::max(half.back() * (1 - kNarrower), kFinest);
    half.push_back(next < narrowest + kFinest / 2 ? narrowest : next);
  }
  return half;
}

/// Strips between two half widths are at most twice their difference thick.
std::int64_t reach_of(double half, double next) { return std::llround(3 * (half - next)); }

/// Follows the edges of strips that are thinner than half of `reach`, and leaves out what another line, or the same one on the
/// other side, has been along.
class StripFollower {
 public:
  StripFollower(std::int64_t reach, Nm gap, std::vector<CentreLine>& lines)
      : reach_(reach), gap_(gap), lines_(lines), grid_(reach) {}

  void follow(std::span<const Point2> contour) {
    line_.point.clear();
    line_.gap = gap_;
    begin_ = count_;
    for (std::size_t i = 0; i <= contour.size(); ++i) {
      const Point2 a = contour[i == 0 ? 0 : i - 1], b = contour[i % contour.size()];
      const auto steps = std::max<std::int64_t>(1, std::llround(std::ceil(2 * distance(a, b) / static_cast<double>(reach_))));
      for (std::int64_t s = i == 0 ? steps : 1; s <= steps; ++s) {
        const double t = static_cast<double>(s) / static_cast<double>(steps);
        step({static_cast<Nm>(std::llround(a.x + t * (static_cast<double>(b.x) - a.x))),
              static_cast<Nm>(std::llround(a.y + t * (static_cast<double>(b.y) - a.y)))});
      }
    }
    end_line();
  }

 private:
  /// Points that follow each other are near each other: those of the last kRecent steps do not count.
  static constexpr std::uint32_t kRecent = 6;

  void step(Point2 at) {
    const std::uint32_t recent = std::max(begin_, count_ - std::min(count_, kRecent));
    std::uint32_t visited = 0;  // one more than the last point here
    grid_.any_near(at, [&](Point2, std::uint32_t number) {
      if (number < recent) visited = std::max(visited, number + 1);
      return false;
    });
    if (visited > 0) {
      // Around the tip of a strip, the way back is noticed late.
      const std::uint32_t back = count_ - visited;
      if (visited > begin_ && back <= 2 * kRecent)
        line_.point.resize(line_.point.size() - std::min<std::size_t>(line_.point.size(), back / 2));
      end_line();
      return;
    }
    grid_.add(at, count_++);
    line_.point.push_back(at);
  }
  void end_line() {
    line_.length = 0;
    for (std::size_t i = 1; i < line_.point.size(); ++i) line_.length += distance(line_.point[i - 1], line_.point[i]);
    if (line_.point.size() > 1) lines_.push_back(line_);
    line_.point.clear();
    begin_ = count_;
  }

  std::int64_t reach_;
  Nm gap_;
  std::vector<CentreLine>& lines_;
  PointGrid grid_;
  CentreLine line_;
  std::uint32_t count_ = 0, begin_ = 0;
};

/// Joins lines at their ends: line l has the ends 2 l (its begin) and 2 l + 1.
class LineJoiner {
 public:
  LineJoiner(const std::vector<CentreLine>& lines, std::int64_t reach) : lines_(lines), next_(2 * lines.size(), kNone) {
    PointGrid ends(reach);
    for (std::uint32_t e = 0; e < next_.size(); ++e) ends.add(point_of(e), e);
    for (std::uint32_t e = 0; e < next_.size(); ++e) {
      if (next_[e] != kNone) continue;
      std::uint32_t nearest = kNone;
      double best = static_cast<double>(reach);
      ends.any_near(point_of(e), [&](Point2 at, std::uint32_t other) {
        const double away = distance(at, point_of(e));
        const bool own = other == (e ^ 1) && lines_[e / 2].length < 4 * static_cast<double>(reach);  // no ring
        if (other != e && next_[other] == kNone && away <= best && !own) {
          best = away;
          nearest = other;
        }
        return false;
      });
      if (nearest == kNone) continue;
      next_[e] = nearest;
      next_[nearest] = e;
    }
  }

  /// Calls begin(), point(at, gap)... and end(closed) for each chain of lines.
  template <class Sink>
  void for_each_chain(Sink&& sink) const {
    std::vector<bool> done(lines_.size());
    for (const bool rings : {false, true}) {  // open chains begin at a free end
      for (std::uint32_t e = 0; e < next_.size(); ++e) {
        if (done[e / 2] || (!rings && next_[e] != kNone)) continue;
        sink.begin();
        std::uint32_t at = e;
        do {
          const CentreLine& line = lines_[at / 2];
          done[at / 2] = true;
          const std::size_t size = line.point.size();
          for (std::size_t i = 0; i < size; ++i) sink.point(line.point[at % 2 == 0 ? i : size - 1 - i], line.gap);
          at = next_[at ^ 1];
        } while (at != kNone && !done[at / 2]);
        sink.end(at == e);
      }
    }
  }

 private:
  static constexpr std::uint32_t kNone = UINT32_MAX;
  Point2 point_of(std::uint32_t end) const {
    const std::vector<Point2>& point = lines_[end / 2].point;
    return end % 2 == 0 ? point.front() : point.back();
  }
  const std::vector<CentreLine>& lines_;
  std::vector<std::uint32_t> next_;  // the end that an end is joined to
};

/// Collects chains with few points.
class ChainCollector {
 public:
  explicit ChainCollector(GapLines& out) : out_(out) {}
  void begin() { point_.clear(), gap_.clear(); }
  void point(Point2 at, Nm gap) {
    if (!point_.empty() && point_.back() == at) {
      gap_.back() = gap;
      return;
    }
    point_.push_back(at);
    gap_.push_back(gap);
  }
  void end(bool closed) {
    if (point_.size() < 2) return;
    if (closed) point(point_.front(), gap_.front());
    double length = 0;
    for (std::size_t i = 1; i < point_.size(); ++i) length += distance(point_[i - 1], point_[i]);
    if (length < static_cast<double>(kShortestLine)) return;
    keep(0);
    for (std::size_t first = 0; first + 1 < point_.size();) {
      // The longest part of one gap that is straight, at least one segment.
      std::size_t last = first + 1;
      while (last + 1 < point_.size() && gap_[last] == gap_[first] && is_straight(first, last + 1)) ++last;
      keep(last);
      first = last;
    }
    out_.lines.close();
  }

 private:
  void keep(std::size_t i) {
    out_.lines.point.push_back(point_[i]);
    out_.gap.push_back(gap_[i]);
  }
  /// Checks some of the points between: a line of n of them takes O(n log n).
  bool is_straight(std::size_t first, std::size_t last) const {
    const Point2 a = point_[first], b = point_[last];
    const double dx = static_cast<double>(b.x) - a.x, dy = static_cast<double>(b.y) - a.y, length = std::hypot(dx, dy);
    if (length == 0) return false;
    const std::size_t stride = std::max<std::size_t>(1, (last - first) / 16);
    for (std::size_t i = first + 1; i < last; i += stride) {
      const double away =
          ((static_cast<double>(point_[i].x) - a.x) * dy - (static_cast<double>(point_[i].y) - a.y) * dx) / length;
      if (std::abs(away) > static_cast<double>(kLineTolerance)) return false;
    }
    return true;
  }
  GapLines& out_;
  std::vector<Point2> point_;
  std::vector<Nm> gap_;
};

}  // namespace

std::uint64_t GapLines::bytes() const {
  const auto of = [](const Contours& c) { return bytes_held(c.point) + bytes_held(c.offset); };
  return of(lines) + of(left) + bytes_held(gap);
}

Result<Contours> narrow_part(const ContoursView& region, const ContoursView& inset, std::int64_t half) {
  const auto wide = offset_contours(inset, half);
  if (!wide) return wide;
  const double lost = square_mm(doubled_area(region) - doubled_area(*wide)) * 1e12;  // nm2
  if (lost < 3 * static_cast<double>(half) * static_cast<double>(half)) return Contours();
  return subtract_contours(region, *wide, false);
}

Contours bare_islands(const ContoursView& contours, Nm width, std::initializer_list<const Contours*> deposited) {
  Contours bare;
  std::optional<PointCells> beads;  // made for the first small island
  for_each_island(contours, [&](std::uint32_t first, std::uint32_t end, double area) {
    if (area > 2 * static_cast<double>(width) * width) return;
    if (!beads) beads.emplace(deposited, width);
    if (!beads->any_in(IslandBox(contours[first]))) append_range(contours, first, end, bare);
  });
  return bare;
}

Contours narrow_features(const ContoursView& narrow, Nm width) {
  Contours features;
  for_each_island(narrow, [&](std::uint32_t first, std::uint32_t end, double area) {
    if (area >= 2 * static_cast<double>(width) * width) append_range(narrow, first, end, features);
  });
  return features;
}

Contours add_dots(const ContoursView& islands, Nm minimum, GapLines& lines) {
  Contours left;
  for_each_island(islands, [&](std::uint32_t first, std::uint32_t end, double area) {
    const IslandBox box(islands[first]);
    const Nm width = box.hi.x - box.lo.x, depth = box.hi.y - box.lo.y;
    if (std::min(width, depth) < minimum) return append_range(islands, first, end, left);
    const Point2 middle{box.lo.x + width / 2, box.lo.y + depth / 2};
    const Nm half = static_cast<Nm>(std::llround(std::sqrt(area) / 4));  // of the line: the bead is round
    const Nm along_x = width >= depth ? half : 0, along_y = half - along_x;
    for (const Nm side : {-1, 1}) {
      lines.lines.point.push_back({middle.x + side * along_x, middle.y + side * along_y});
      lines.gap.push_back(static_cast<Nm>(std::llround(area / (2.0 * half))));
    }
    lines.lines.close();
  });
  return left;
}

std::uint64_t bound_gap_points(const ContoursView& region, const GapWidths& widths) {
  if (region.size() == 0) return 0;
  const std::vector<double> half = half_widths(widths);
  double step = widths.maximum;
  for (std::size_t i = 1; i < half.size(); ++i) step = std::min(step, static_cast<double>(reach_of(half[i - 1], half[i])) / 2);
  double length = 0;
  for (std::uint32_t c = 0; c < region.size(); ++c) {
    Point2 last = region[c].back();
    for (const Point2 p : region[c]) length += distance(std::exchange(last, p), p);
  }
  return static_cast<std::uint64_t>(length / step) + 4 * region.point.size();
}

namespace {

/// Without pieces that no line fits into: their area is below that of the shortest one, or their mean width far below the
/// minimum.
Contours without_specks(const ContoursView& region, Nm minimum) {
  Contours kept;
  for_each_island(region, [&](std::uint32_t first, std::uint32_t end, double area) {
    if (area < static_cast<double>(kShortestLine) * minimum) return;
    double edge = 0;
    for (std::uint32_t c = first; c < end; ++c) {
      Point2 last = region[c].back();
      for (const Point2 p : region[c]) edge += distance(std::exchange(last, p), p);
    }
    if (2 * area >= 0.3 * minimum * edge) append_range(region, first, end, kept);
  });
  return kept;
}

}  // namespace

namespace {

/// Widens lines by what their ends lack, so that they have the volume of the piece; as far as a bead spreads.
void scale_to(double area, GapLines& lines, std::uint32_t first) {
  constexpr double kWidest = 1.35;
  double sum = 0;
  for (std::uint32_t c = first; c < lines.lines.size(); ++c) {
    for (std::uint32_t i = lines.lines.offset[c]; i + 1 < lines.lines.offset[c + 1]; ++i)
      sum += distance(lines.lines.point[i], lines.lines.point[i + 1]) * lines.gap[i];
  }
  if (!(sum > 0)) return;
  const double factor = std::clamp(area / sum, 1.0, kWidest);
  for (std::uint32_t i = lines.lines.offset[first]; i < lines.gap.size(); ++i)
    lines.gap[i] = static_cast<Nm>(std::llround(lines.gap[i] * factor));
}

/// A compact piece that is more than a corner.
bool deserves_dot(const IslandBox& box, double area, const GapWidths& widths) {
  const double around = (static_cast<double>(box.hi.x) - box.lo.x) * (static_cast<double>(box.hi.y) - box.lo.y);
  const double whole = static_cast<double>(widths.maximum) * widths.maximum;
  return area >= whole / 8 && area <= whole && area >= around / 2;
}

/// nm, a bound of the radius of circles in a contour: half of the extent across an edge, the circle of the same area, and that
/// of a tangential polygon for convex contours.
double bound_radius(std::span<const Point2> contour) {
  constexpr std::size_t kEdges = 32;  // of longer contours, so many are measured
  const double area = square_mm(doubled_area(contour)) * 1e12;
  double radius = std::sqrt(area / std::numbers::pi), perimeter = 0;
  bool convex = true;
  const std::size_t stride = (contour.size() + kEdges - 1) / kEdges;
  for (std::size_t i = 0; i < contour.size(); i += stride) {
    const Point2 a = contour[i], b = contour[i + 1 < contour.size() ? i + 1 : 0];
    const double dx = static_cast<double>(b.x) - a.x, dy = static_cast<double>(b.y) - a.y, length = std::hypot(dx, dy);
    double low = 0, high = 0;
    for (const Point2 p : contour) {
      const double away = dx * (static_cast<double>(p.y) - a.y) - dy * (static_cast<double>(p.x) - a.x);
      low = std::min(low, away);
      high = std::max(high, away);
    }
    perimeter += length;
    convex &= low >= 0;
    if (length > 0) radius = std::min(radius, (high - low) / (2 * length));
  }
  return convex && stride == 1 && perimeter > 0 ? std::min(radius, 2 * area / perimeter) : radius;
}

/// An outer contour with its holes.
struct Island {
  Contours contours;
  double radius;  // nm, at most, of circles in it
};

void append_islands(const ContoursView& region, std::vector<Island>& islands) {
  for_each_island(region, [&](std::uint32_t first, std::uint32_t end, double) {
    islands.push_back({Contours(), bound_radius(region[first])});
    append_range(region, first, end, islands.back().contours);
  });
}

/// Follows the strip of an island between two half widths, and appends what the line along it does not cover to `rest`.
Status follow_strip(Island& island, std::int64_t half, StripFollower& follower, std::vector<Island>& rest) {
  const auto strips = offset_contours(island.contours, -half);
  if (!strips) return strips.error();
  if (strips->size() == 0) {
    rest.push_back(std::move(island));
    return {};
  }
  for (std::uint32_t c = 0; c < strips->size(); ++c) follower.follow((*strips)[c]);
  const auto covered = offset_contours(*strips, half);
  const auto bare = covered ? subtract_contours(island.contours, *covered, false) : covered;
  if (!bare) return bare.error();
  append_islands(*bare, rest);
  return {};
}

/// The lines of one connected piece.
Status add_lines_of(const ContoursView& piece, const GapWidths& widths, const std::vector<double>& half, GapLines& made) {
  std::vector<CentreLine> lines;
  std::vector<Island> islands, rest;
  append_islands(piece, islands);
  for (std::size_t i = 1; i < half.size(); ++i) {
    const std::int64_t next = std::llround(half[i]);
    const auto may_fit = [&](const Island& island) { return island.radius + kRounding >= static_cast<double>(next); };
    if (std::ranges::none_of(islands, may_fit)) continue;
    StripFollower follower(reach_of(half[i - 1], half[i]), static_cast<Nm>(std::llround(half[i - 1] + half[i])), lines);
    rest.clear();
    for (Island& island : islands) {
      if (!may_fit(island)) {
        rest.push_back(std::move(island));
      } else if (Status status = follow_strip(island, next, follower, rest); !status) {
        return status;
      }
    }
    islands.swap(rest);
  }
  const std::uint32_t first = made.lines.size();
  // The strip of a smaller half width begins the sum of both further on.
  LineJoiner(lines, widths.maximum).for_each_chain(ChainCollector(made));
  double left = 0;
  for (const Island& island : islands) left += square_mm(doubled_area(island.contours)) * 1e12;
  const double area = square_mm(doubled_area(piece)) * 1e12;
  if (made.lines.size() > first) {
    scale_to(area - left, made, first);
  } else if (deserves_dot(IslandBox(piece[0]), area, widths)) {
    add_dots(piece, widths.minimum, made);
    return {};
  }
  for (const Island& island : islands) made.left.append(island.contours);
  return {};
}

}  // namespace

Result<GapLines> gap_lines(const ContoursView& narrow, const GapWidths& widths) {
  GapLines made;
  const Contours region = without_specks(narrow, widths.minimum);
  const std::vector<double> half = half_widths(widths);
  Status status;
  for_each_island(region, [&](std::uint32_t first, std::uint32_t end, double) {
    Contours piece;
    append_range(region, first, end, piece);
    if (status) status = add_lines_of(piece, widths, half, made);
  });
  return status ? Result<GapLines>(std::move(made)) : status.error();
}

void append_gap_lines(const GapLines& lines, double height_mm, BeadShape shape, PathKind kind, Toolpaths& out) {
  for (std::uint32_t c = 0; c < lines.lines.size(); ++c) {
    for (std::uint32_t i = lines.lines.offset[c]; i < lines.lines.offset[c + 1]; ++i) {
      const bool last = i + 1 == lines.lines.offset[c + 1];  // repeats the entries before it
      const double area = mm(lines.gap[last ? i - 1 : i]) * height_mm;
      out.add(lines.lines.point[i], kind, static_cast<Nm>(nm_of(bead_width(area, height_mm, shape))));
    }
    out.close();
  }
}

}  // namespace lamina::infill
