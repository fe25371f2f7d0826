#include "stages/infill/solid.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "stages/geometry/bead_section.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/components.h"
#include "stages/infill/density.h"
#include "stages/infill/gaps.h"
#include "stages/infill/layout.h"
#include "stages/infill/lines.h"

namespace lamina::infill {
namespace {

/// Solid lines of one connected region of bead centres, in their frame: so many of one width that they fill it from side to
/// side. Their number is the next one to a pitch, so wide regions have beads of the set width, and narrow ones up to half more.
struct SolidLines {
  LinePositions positions;
  double pitch;  // nm
};
SolidLines solid_lines(const ContoursView& inset, double pitch) {
  const auto [low, high] = std::ranges::minmax_element(inset.point, {}, &Point2::y);
  const std::int64_t from = low->y, to = std::int64_t{high->y} - 1;  // a line at the highest point crosses nothing
  const double strip = static_cast<double>(to - from) + pitch;
  const auto count = std::max<std::int64_t>(1, std::llround(strip / pitch));
  SolidLines lines{{}, strip / static_cast<double>(count)};
  lines.positions.at.reserve(static_cast<std::size_t>(count));
  for (std::int64_t i = 0; i < count; ++i) {
    const double at = static_cast<double>(from) - pitch / 2 + (static_cast<double>(i) + 0.5) * lines.pitch;
    lines.positions.at.push_back(std::clamp<std::int64_t>(std::llround(at), from, std::max(from, to)));
  }
  return lines;
}

/// Calls use(region) for each outer contour with the holes in it. region  clean contours
template <class Use>
void for_each_region(const ContoursView& region, Use use) {
  Buffer<std::uint32_t> rebased;
  for_each_component(region, [&](std::uint32_t begin, std::uint32_t end) { use(range_of(region, begin, end, rebased)); });
}

/// Rectangles around segments, in the frame of the lines.
class CoveredArea {
 public:
  explicit CoveredArea(double pitch) : half_(pitch / 2 + kOverlap) {}

  /// Begins and ends half a pitch beyond the segment.
  void add(Point2 a, Point2 b) {
    const double length = distance(a, b);
    if (length == 0) return;
    const double ux = (static_cast<double>(b.x) - a.x) / length * half_, uy = (static_cast<double>(b.y) - a.y) / length * half_;
    const auto corner = [&](Point2 end, double along, double left) {
      area_.point.push_back({static_cast<Nm>(std::llround(end.x + along * ux - left * uy)),
                             static_cast<Nm>(std::llround(end.y + along * uy + left * ux))});
    };
    corner(a, -1, -1), corner(b, 1, -1), corner(b, 1, 1), corner(a, -1, 1);
    area_.close();
  }
  void add(const ToolpathsView& paths, std::uint32_t first, const Frame& frame) {
    Contours path;
    for (std::uint32_t p = first; p < paths.size(); ++p) {
      path.clear();
      path.point.insert(path.point.end(), paths[p].begin(), paths[p].end());
      path.close();
      const Contours in_frame = frame.to(path);
      for (std::size_t i = 0; i + 1 < in_frame.point.size(); ++i) add(in_frame.point[i], in_frame.point[i + 1]);
    }
  }
  /// The edge between the ends of neighbouring lines, if it is not longer than a link. Every second interval is a link, which
  /// has the volume of both; the others get no bead.
  void add_intervals(const ContoursView& centres, const LinePositions& lines, std::int64_t longest_link);

  const Contours& area() const { return area_; }

 private:
  static constexpr double kOverlap = 2000;  // nm: rounding leaves no sliver between neighbours
  double half_;
  Contours area_;
};

/// A point of an edge, or where a line crosses it.
struct EdgeNode {
  static constexpr std::int64_t kNoCrossing = -1;
  Point2 at;
  std::int64_t line = kNoCrossing;
};

void append_nodes(Point2 a, Point2 b, std::span<const std::int64_t> lines, std::vector<EdgeNode>& nodes) {
  nodes.push_back({a});
  const auto below = [&](Point2 p) { return std::ranges::lower_bound(lines, std::int64_t{p.y}) - lines.begin(); };
  const std::ptrdiff_t from = below(a), to = below(b), step = to > from ? 1 : -1;
  for (std::ptrdiff_t k = from; k != to; k += step) {
    const std::ptrdiff_t line = step > 0 ? k : k - 1;
    const double t = (static_cast<double>(lines[static_cast<std::size_t>(line)]) - a.y) / (static_cast<double>(b.y) - a.y);
    nodes.push_back({{static_cast<Nm>(std::llround(a.x + t * (static_cast<double>(b.x) - a.x))),
                      static_cast<Nm>(lines[static_cast<std::size_t>(line)])},
                     line});
  }
}

void CoveredArea::add_intervals(const ContoursView& centres, const LinePositions& lines, std::int64_t longest_link) {
  std::vector<EdgeNode> nodes;
  for (std::uint32_t c = 0; c < centres.size(); ++c) {
    const auto points = centres[c];
    nodes.clear();
    for (std::size_t i = 0; i < points.size(); ++i) append_nodes(points[i], points[(i + 1) % points.size()], lines.at, nodes);
    const auto is_crossing = [](const EdgeNode& node) { return node.line != EdgeNode::kNoCrossing; };
    const auto first = std::ranges::find_if(nodes, is_crossing);
    if (first == nodes.end()) continue;
    std::rotate(nodes.begin(), first, nodes.end());
    nodes.push_back(nodes.front());
    for (std::size_t begin = 0, end = 0; begin + 1 < nodes.size(); begin = end) {
      end = begin + 1;
      while (!is_crossing(nodes[end])) ++end;
      double length = 0;
      for (std::size_t i = begin; i < end; ++i) length += distance(nodes[i].at, nodes[i + 1].at);
      if (nodes[begin].line == nodes[end].line || length > static_cast<double>(longest_link)) continue;
      for (std::size_t i = begin; i < end; ++i) add(nodes[i].at, nodes[i + 1].at);
    }
  }
}

/// Appends the lines of one connected region, in their frame, and single beads where they leave room. own  of its lines
Status append_component(const ContoursView& solid, double pitch, const Frame& frame, double height_mm, FillParameters& own,
                        Toolpaths& out) {
  const auto centres = offset_contours(solid, -std::llround(pitch / 2));
  if (!centres) return centres.error();
  const std::uint32_t before = out.size();
  CoveredArea covered(pitch);
  for_each_region(*centres, [&](const ContoursView& component) {
    const SolidLines lines = solid_lines(component, pitch);
    own.width = static_cast<Nm>(nm_of(bead_width(lines.pitch * 1e-6 * height_mm, height_mm, own.shape)));
    append_raster(component, own, lines.positions, frame, out);
    covered.add_intervals(component, lines.positions, own.longest_link);
  });
  covered.add(out, before, frame);
  if (!own.varies_width) return {};
  // In the frame few beads are next to each other along a scan line of Clipper.
  const auto rest = subtract_contours(solid, covered.area(), false);
  if (!rest) return rest.error();
  auto lines = gap_lines(*rest, {static_cast<Nm>(2 * pitch), min_gap(pitch)});
  if (!lines) return lines.error();
  for (Point2& p : lines->lines.point) p = frame.from(p);
  append_gap_lines(*lines, height_mm, own.shape, PathKind::kSolid, out);
  return {};
}

}  // namespace

Status append_solid(const Outlines& outlines, const FillContext& context, const FillParameters& parameters, Toolpaths& out) {
  if (outlines.solid.size() == 0) return {};
  const double pitch = solid_pitch(parameters, parameters.width, context.layer.thickness);
  const Frame frame = frame_of(context, parameters);
  const std::size_t first_point = out.point.size();
  FillParameters own = parameters;
  own.pattern = Pattern::kRaster;
  own.fills_corners = true;
  // Along edges that are nearly parallel to the lines, single beads fill what is left between the ends of lines.
  own.longest_link = std::llround(1.5 * pitch);
  Status status;
  for_each_region(frame.to(outlines.solid), [&](const ContoursView& component) {
    if (status) status = append_component(component, pitch, frame, mm(context.layer.thickness), own, out);
  });
  std::fill(out.kind.begin() + static_cast<std::ptrdiff_t>(first_point), out.kind.end(), PathKind::kSolid);
  return status;
}

SolidBound bound_solid(const Outlines& outlines, const FillContext& context, const FillParameters& parameters) {
  const double pitch = solid_pitch(parameters, parameters.width, context.layer.thickness);
  SolidBound bound;
  for_each_region(frame_of(context, parameters).to(outlines.solid_centres), [&](const ContoursView& component) {
    bound.crossings += count_crossings(component, solid_lines(component, pitch).positions);
  });
  bound.gap_points = bound_gap_points(outlines.solid, {static_cast<Nm>(2 * pitch), min_gap(pitch)});
  return bound;
}

}  // namespace lamina::infill
