#include "stages/infill/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>

#include "stages/infill/lines.h"

namespace lamina::infill {
namespace {

constexpr std::int64_t kMaxLines = 10'000'000;

std::int64_t wrapped(std::int64_t i, std::int64_t size) { return ((i % size) + size) % size; }

/// Gap of a height by the table, in proportion between its entries.
std::int64_t by_table(const std::vector<std::pair<std::int64_t, Nm>>& table, std::int64_t z) {
  const auto after = std::ranges::upper_bound(table, z, {}, &std::pair<std::int64_t, Nm>::first);
  if (after == table.begin()) return table.front().second;
  if (after == table.end()) return table.back().second;
  const auto& [z0, g0] = *(after - 1);
  const auto& [z1, g1] = *after;
  return g0 + floor_div<std::int64_t>((std::int64_t{g1} - g0) * 2 * (z - z0) + (z1 - z0), 2 * (z1 - z0));
}

/// The distances from one line to the next.
class Distances {
 public:
  static Result<Distances> make(const FillParameters& parameters, const FillContext& context, const Extent& extent) {
    Distances distances(parameters, context, extent);
    if (!parameters.gap_expression.empty() && parameters.distances.empty()) {
      auto parsed = Expression::parse(parameters.gap_expression);
      if (!parsed) return parsed.error();
      distances.expression_.emplace(std::move(*parsed));
    }
    return distances;
  }

  /// From line i, which lies `position` nm from the part's side, to line i + 1. nm, > 0
  Result<std::int64_t> operator()(std::int64_t i, std::int64_t position) {
    std::int64_t distance = 0;
    if (!parameters_.distances.empty()) {
      const auto size = static_cast<std::int64_t>(parameters_.distances.size());
      distance = parameters_.distances[static_cast<std::size_t>(wrapped(i, size))];
    } else {
      const auto gap = gap_after(i, position);
      if (!gap) return gap;
      distance = parameters_.width + *gap;
    }
    if (parameters_.pattern == Pattern::kQuatrefoil && distance <= parameters_.width) {
      return Error{Fault::kUsage,
                   fmt::format("layer {}: a quatrefoil's lines are kept apart, but the gap after line {} is {} mm; give one "
                               "above 0, and groups of 1",
                               context_.layer.index, i, mm(distance - parameters_.width))};
    }
    if (distance <= 0) {
      return Error{Fault::kUsage,
                   fmt::format("layer {}: line {} would lie {} mm from line {}, centre to centre; bead width plus gap has "
                               "to be above 0",
                               context_.layer.index, i + 1, mm(distance), i)};
    }
    return distance;
  }

 private:
  Distances(const FillParameters& parameters, const FillContext& context, const Extent& extent)
      : parameters_(parameters), context_(context), extent_(extent) {}

  Result<std::int64_t> gap_after(std::int64_t i, std::int64_t position) {
    const auto group = static_cast<std::int64_t>(parameters_.group);
    if (wrapped(i + 1, group) != 0) return std::int64_t{0};
    const std::int64_t z = std::int64_t{context_.layer.plane()} - context_.part.lo.z;
    if (expression_) {
      const auto height = static_cast<double>(context_.part.height()), length = static_cast<double>(extent_.length);
      Expression::Variables variables;
      variables.z = mm(z);
      variables.h = height > 0 ? static_cast<double>(z) / height : 0;
      variables.n = context_.layer.index + 1.0;
      variables.a = static_cast<double>(layer_angle(parameters_, context_.layer.index)) * 1e-6;
      variables.i = static_cast<double>(i);
      // A line that would lie outside of the part counts as one at its side: so does the wall that a part without walls
      // has half a bead before its surface. A formula has to hold within the part only.
      const std::int64_t within = std::clamp<std::int64_t>(position, 0, extent_.length);
      variables.s = mm(within);
      variables.u = length > 0 ? static_cast<double>(within) / length : 0;
      const auto value = (*expression_)(variables);
      if (!value) return value.error();
      if (std::abs(*value) > mm(kNmReach)) {
        return Error{Fault::kUsage, fmt::format("'{}': is {} mm in layer {}; gaps end at {} mm", parameters_.gap_expression,
                                                *value, context_.layer.index, mm(kNmReach))};
      }
      return nm_of(*value);
    }
    if (!parameters_.gap_table.empty()) return by_table(parameters_.gap_table, z);
    const std::int64_t turn = floor_div(i, group);
    return std::int64_t{
        parameters_.gaps[static_cast<std::size_t>(wrapped(turn, static_cast<std::int64_t>(parameters_.gaps.size())))]};
  }

  const FillParameters& parameters_;
  const FillContext& context_;
  const Extent& extent_;
  std::optional<Expression> expression_;
};

/// Of the centre of the innermost wall from the surface; without walls as if there were one before the surface.
std::int64_t wall_centre(const FillParameters& parameters) {
  if (parameters.walls == 0) return -std::int64_t{parameters.width} / 2;
  return (2 * std::int64_t{parameters.walls} - 1) * parameters.wall_width / 2;
}

/// The part's sides across the lines, and nothing to fill.
Extent sides_of(const Box& part, const Frame& frame) {
  const Box turned = frame.to(part);
  return {turned.lo.y, turned.depth(), turned.hi.y, turned.lo.y};
}

/// Lines of a layer by the gaps or distances of the parameters.
Result<LinePositions> line_positions(const FillParameters& parameters, const FillContext& context, const Extent& extent) {
  const auto first = first_position(parameters, context, extent);
  if (!first) return first.error();
  auto distances = Distances::make(parameters, context, extent);
  if (!distances) return distances.error();
  const std::int64_t shift = layer_stagger(parameters, context.layer.index);
  // Positions count from the part's side and without the stagger while lines are placed. No line is nearer to either
  // side of the part than the first one.
  std::int64_t lowest = extent.low - extent.side, high = extent.high - extent.side;
  if (extent.off_sides) {
    lowest = std::max(lowest, *first);
    high = std::min(high, extent.length - *first);
  }
  lowest -= shift;
  high -= shift;

  const auto too_many = [&] {
    return Error{Fault::kUsage,
                 fmt::format("layer {}: more than {} lines; give wider beads or gaps", context.layer.index, kMaxLines)};
  };
  LinePositions positions;
  Buffer<std::int64_t> before;
  std::int64_t position = *first;
  for (std::int64_t i = -1; position > lowest; --i) {
    // Backwards: the distance is that of line i, evaluated where it would be if its gap were that of line i + 1.
    const auto distance = (*distances)(i, position);
    if (!distance) return distance.error();
    position -= *distance + extent.line_height;
    if (position < lowest) break;
    before.push_back(position);
    if (static_cast<std::int64_t>(before.size()) > kMaxLines) return too_many();
  }
  std::reverse(before.begin(), before.end());
  std::int32_t number = -static_cast<std::int32_t>(before.size());
  bool begun = false;
  const auto add = [&](std::int64_t at) {
    if (at >= lowest && at <= high) {
      if (!begun) positions.first_number = number;
      begun = true;
      positions.at.push_back(at + extent.side + shift);
    }
    ++number;
  };
  for (const std::int64_t at : before) add(at);
  position = *first;
  for (std::int64_t i = 0; position <= high; ++i) {
    add(position);
    if (i > kMaxLines) return too_many();
    const auto distance = (*distances)(i, position);
    if (!distance) return distance.error();
    position += *distance + extent.line_height;
  }
  return positions;
}

}  // namespace

Result<std::int64_t> first_position(const FillParameters& parameters, const FillContext& context, const Extent& extent) {
  if (parameters.first_line) return std::int64_t{*parameters.first_line};
  auto distances = Distances::make(parameters, context, extent);
  if (!distances) return distances.error();
  // As far from the wall as the line after a gap is from the one before it.
  const std::int64_t before = parameters.distances.empty() ? std::int64_t{parameters.group} - 1 : -1;
  const auto distance = (*distances)(before, wall_centre(parameters));
  if (!distance) return distance;
  return wall_centre(parameters) + *distance;
}

Frame frame_of(const FillContext& context, const FillParameters& parameters) {
  const Box& part = context.part;
  return Frame(layer_angle(parameters, context.layer.index), {static_cast<Nm>((std::int64_t{part.lo.x} + part.hi.x) / 2),
                                                              static_cast<Nm>((std::int64_t{part.lo.y} + part.hi.y) / 2)});
}

Result<std::int64_t> region_depth(const FillContext& context, const FillParameters& parameters) {
  const std::int64_t wall = parameters.walls > 0 ? wall_centre(parameters) : 0;
  if (parameters.end_inset) return wall + *parameters.end_inset;
  if (parameters.walls == 0) return std::int64_t{parameters.width} / 2;
  // From the wall's centre to the first line, as line after line: what beads overlap each other, they overlap the wall.
  FillParameters from_surface = parameters;
  from_surface.first_line.reset();
  from_surface.walls = 0;
  const auto first = first_position(from_surface, context, sides_of(context.part, frame_of(context, parameters)));
  if (!first) return first;
  return wall + (std::int64_t{parameters.wall_width} + parameters.width) / 2 +
         std::min<std::int64_t>(0, *first + parameters.width / 2 - parameters.width);
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
  Box box;
  for (const Point2 p : region.point) box.add(Point3{p.x, p.y, 0});
  if (region.point.empty()) return LinePositions();
  FillParameters own = parameters;
  if (!own.first_line) own.first_line = static_cast<Nm>(std::min<std::int64_t>(*depth, kNmReach));
  // No point is further inside than half the narrower side of the box; the surface is the side that all is measured from.
  const std::int64_t low = std::max<std::int64_t>(*depth, *own.first_line);
  const std::int64_t high = *depth + std::min(box.width(), box.depth()) / 2 + 1;
  Extent extent{0, high, low, high};
  extent.off_sides = false;
  return line_positions(own, context, extent);
}

Result<Expression> Expression::parse(const std::string& text) {
  static constexpr std::string_view kNames[] = {"z", "h", "n", "a", "i", "s", "u"};
  auto formula = Formula::parse(text, kNames);
  if (!formula) return formula.error();
  return Expression(std::move(*formula));
}

Result<double> Expression::operator()(const Variables& of) {
  const std::array values{of.z, of.h, of.n, of.a, of.i, of.s, of.u};
  const Result<double> value = formula_(values);
  if (value && !std::isfinite(*value)) {
    return Error{Fault::kUsage, fmt::format("'{}': is {} where z = {:g}, n = {:g}, i = {:g}, s = {:g}; it has to be a "
                                            "finite number of mm",
                                            formula_.text(), *value, of.z, of.n, of.i, of.s)};
  }
  return value;
}

}  // namespace lamina::infill
