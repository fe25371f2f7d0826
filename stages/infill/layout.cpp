#include "stages/infill/layout.h"

#include <algorithm>

#include "stages/infill/waves.h"

namespace lamina::infill {
namespace {

struct NumberRange {
  std::int64_t low = INT64_MAX, high = INT64_MIN;
  void add(std::int64_t v) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
};

/// The part's sides across the lines, and nothing to fill.
Extent sides_of(const Box& part, const Frame& frame) {
  NumberRange v;
  for (const Nm x : {part.lo.x, part.hi.x}) {
    for (const Nm y : {part.lo.y, part.hi.y}) v.add(frame.to(Point2{x, y}).y);
  }
  return {v.low, v.high - v.low, v.high, v.low};
}

std::int64_t centre_of_walls(const FillParameters& parameters) {
  const std::int64_t walls = parameters.walls;
  return walls > 0 ? (2 * walls - 1) * parameters.wall_width / 2 : 0;
}

/// From the wall's centre to the first line, as line after line: what beads overlap each other, they overlap the wall.
Result<std::int64_t> distance_from_wall(const FillContext& context, const FillParameters& parameters) {
  FillParameters from_surface = parameters;
  from_surface.first_line.reset();
  from_surface.walls = 0;
  const auto first = first_position(from_surface, context, sides_of(context.part, frame_of(context, parameters)));
  if (!first) return first;
  return *first + parameters.width / 2;
}

}  // namespace

Frame frame_of(const FillContext& context, const FillParameters& parameters) {
  const Box& part = context.part;
  return Frame(layer_angle(parameters, context.layer.index), {static_cast<Nm>((std::int64_t{part.lo.x} + part.hi.x) / 2),
                                                              static_cast<Nm>((std::int64_t{part.lo.y} + part.hi.y) / 2)});
}

Result<std::int64_t> region_depth(const FillContext& context, const FillParameters& parameters) {
  const std::int64_t wall = centre_of_walls(parameters);
  if (parameters.end_inset) return wall + *parameters.end_inset;
  if (parameters.walls == 0) return std::int64_t{parameters.width} / 2;
  const auto distance = distance_from_wall(context, parameters);
  if (!distance) return distance;
  return wall + (std::int64_t{parameters.wall_width} + parameters.width) / 2 +
         std::min<std::int64_t>(0, *distance - parameters.width);
}

Result<LinePositions> positions_across(const ContoursView& region, const Frame& frame, const FillContext& context,
                                       const FillParameters& parameters) {
  Extent extent = sides_of(context.part, frame);
  for (const Point2 p : region.point) {
    extent.low = std::min<std::int64_t>(extent.low, p.y);
    extent.high = std::max<std::int64_t>(extent.high, p.y);
  }
  if (!is_wave(parameters.pattern)) return line_positions(parameters, context, extent);
  // Waves are cut off at the region's edge: those that begin outside it count.
  extent.line_height = wave_height(parameters);
  extent.low -= extent.line_height;
  extent.off_sides = false;
  FillParameters own = parameters;
  if (!own.first_line) own.first_line = parameters.width / 2;
  return line_positions(own, context, extent);
}

Result<LinePositions> positions_inwards(const ContoursView& region, const FillContext& context,
                                        const FillParameters& parameters) {
  const auto depth = region_depth(context, parameters);
  if (!depth) return depth.error();
  NumberRange x, y;
  for (const Point2 p : region.point) x.add(p.x), y.add(p.y);
  LinePositions none;
  if (region.point.empty()) return none;
  FillParameters own = parameters;
  if (!own.first_line) own.first_line = static_cast<Nm>(std::min<std::int64_t>(*depth, kNmReach));
  // No point is further inside than half the narrower side of the box; the surface is the side that all is measured from.
  const std::int64_t low = std::max<std::int64_t>(*depth, *own.first_line);
  const std::int64_t high = *depth + std::min(x.high - x.low, y.high - y.low) / 2 + 1;
  Extent extent{0, high, low, high};
  extent.off_sides = false;
  return line_positions(own, context, extent);
}

}  // namespace lamina::infill
