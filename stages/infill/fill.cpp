#include "stages/infill/fill.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "stages/data/clipping.h"
#include "stages/infill/expression.h"
#include "stages/infill/raster.h"
#include "stages/infill/waves.h"

namespace lamina::infill {
namespace {

/// A closed path: the first point comes again at the end.
void append_closed(const ContoursView& contours, PathKind kind, Nm width, Toolpaths& out) {
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    for (const Point2 p : contours[c]) out.add(p, kind, width);
    out.add(contours[c].front(), kind, width);
    out.close();
  }
}

/// The part's box in the frame of a layer's lines.
struct TurnedBox {
  std::int64_t low_u, low_v, high_v;
};
TurnedBox turned(const Box& part, const Frame& frame) {
  TurnedBox box{INT64_MAX, INT64_MAX, INT64_MIN};
  for (const Nm x : {part.lo.x, part.hi.x}) {
    for (const Nm y : {part.lo.y, part.hi.y}) {
      const Point2 p = frame.to(Point2{x, y});
      box.low_u = std::min<std::int64_t>(box.low_u, p.x);
      box.low_v = std::min<std::int64_t>(box.low_v, p.y);
      box.high_v = std::max<std::int64_t>(box.high_v, p.y);
    }
  }
  return box;
}

Frame frame_of(const FillContext& context, const FillParameters& parameters) {
  const Box& part = context.part;
  return Frame(layer_angle(parameters, context.layer.index),
               {static_cast<Nm>((std::int64_t{part.lo.x} + part.hi.x) / 2),
                static_cast<Nm>((std::int64_t{part.lo.y} + part.hi.y) / 2)});
}

Extent extent_of(const Box& part, const Frame& frame, const ContoursView& region) {
  const TurnedBox box = turned(part, frame);
  Extent extent{box.low_v, box.high_v - box.low_v, box.high_v, box.low_v};
  for (const Point2 p : region.point) {
    extent.low = std::min<std::int64_t>(extent.low, p.y);
    extent.high = std::max<std::int64_t>(extent.high, p.y);
  }
  return extent;
}

/// One distance between lines of this layer, for what needs only one: links, closed curves, overlap with the wall.
Result<std::int64_t> one_distance(const FillContext& context, const FillParameters& parameters) {
  const Extent extent = extent_of(context.part, frame_of(context, parameters), {});
  FillParameters from_zero = parameters;
  from_zero.first_line.reset();
  from_zero.walls = 0;
  const auto first = first_place(from_zero, context, extent);
  if (!first) return first;
  return *first + parameters.width / 2;
}

Status append_lines(const ContoursView& region, const FillContext& context, const FillParameters& parameters,
                    Toolpaths& out) {
  const Frame frame = frame_of(context, parameters);
  const Contours turned_region = frame.to(region);
  const Extent extent = extent_of(context.part, frame, turned_region);
  if (parameters.pattern == Pattern::kHoneycomb || parameters.pattern == Pattern::kQuatrefoil) {
    const auto distance = one_distance(context, parameters);
    if (!distance) return distance.error();
    return append_waves(turned_region, parameters, static_cast<Nm>(*distance - parameters.width), extent.side,
                        layer_stagger(parameters, context.layer.index), turned(context.part, frame).low_u, frame, out);
  }
  const auto places = place_lines(parameters, context, extent);
  if (!places) return places.error();
  RasterOptions options{parameters.width, parameters.longest_link, parameters.shortest_line};
  if (parameters.longest_link < 0) {
    std::int64_t widest = 0;
    for (std::size_t i = 1; i < places->at.size(); ++i) widest = std::max(widest, places->at[i] - places->at[i - 1]);
    options.longest_link = 3 * widest;
  }
  append_raster(turned_region, *places, frame, options, out);
  return {};
}

/// Closed curves inwards from the edge of the region: all that fit, or `most` of them. Leaves in `region` what they
/// enclose, moved inwards once more.
Status append_curves(Contours& region, const FillParameters& parameters, std::int64_t distance, std::uint32_t most,
                     Toolpaths& out) {
  for (std::uint32_t k = 0; k < most && region.size() > 0; ++k) {
    append_closed(region, PathKind::kContour, parameters.width, out);
    auto next = offset_contours(region, -distance);
    if (!next) return next.error();
    region = std::move(*next);
  }
  return {};
}

}  // namespace

Status check(const FillParameters& parameters) {
  const auto wrong = [](const std::string& what) { return Error{Fault::kUsage, what}; };
  if (parameters.width <= 0) return wrong("the bead width has to be above 0");
  if (parameters.walls > 0 && parameters.wall_width <= 0) return wrong("the wall's bead width has to be above 0");
  if (parameters.build_layers == 0) return wrong("the number of layers with one angle has to be 1 or more");
  if (parameters.group == 0) return wrong("the number of beads in a group has to be 1 or more");
  if (parameters.gaps.empty()) return wrong("no gap is given; 0 lays beads side by side");
  for (const Nm distance : parameters.distances) {
    if (distance <= 0) return wrong(fmt::format("{} mm between lines; the distance has to be above 0", mm(distance)));
  }
  if (parameters.distances.empty() && parameters.gap_expression.empty()) {
    for (const Nm gap : parameters.gaps) {
      if (std::int64_t{parameters.width} + gap <= 0) {
        return wrong(fmt::format("a gap of {} mm with beads of {} mm leaves {} mm from line to line; it has to be above 0",
                                 mm(gap), mm(parameters.width), mm(std::int64_t{parameters.width} + gap)));
      }
    }
    for (std::size_t i = 0; i < parameters.gap_table.size(); ++i) {
      const auto& [z, gap] = parameters.gap_table[i];
      if (i > 0 && z <= parameters.gap_table[i - 1].first) {
        return wrong(fmt::format("height {} mm of the gap table is not above the one before; give them in order", mm(z)));
      }
      if (std::int64_t{parameters.width} + gap <= 0) {
        return wrong(fmt::format("a gap of {} mm at {} mm with beads of {} mm leaves nothing from line to line", mm(gap),
                                 mm(z), mm(parameters.width)));
      }
    }
  }
  if (!parameters.gap_expression.empty()) {
    if (auto parsed = Expression::parse(parameters.gap_expression); !parsed) return parsed.error();
  }
  if (parameters.cell <= 0) return wrong("cells have to be wider than 0");
  return {};
}

Result<Contours> fill_region(const ContoursView& contours, const FillContext& context, const FillParameters& parameters) {
  const std::int64_t walls = parameters.walls;
  const std::int64_t wall_centre = walls > 0 ? (2 * walls - 1) * parameters.wall_width / 2 : 0;
  std::int64_t inset = 0;
  if (parameters.end_inset) {
    inset = *parameters.end_inset;
  } else if (walls > 0) {
    const auto distance = one_distance(context, parameters);
    if (!distance) return distance.error();
    inset = (std::int64_t{parameters.wall_width} + parameters.width) / 2 +
            std::min<std::int64_t>(0, *distance - parameters.width);
  } else {
    inset = parameters.width / 2;
  }
  return offset_contours(contours, -(wall_centre + inset));
}

Status append_fill(const ContoursView& contours, const FillContext& context, const FillParameters& parameters,
                   Toolpaths& out) {
  if (contours.size() == 0) return {};
  for (std::uint32_t wall = 0; wall < parameters.walls; ++wall) {
    auto moved = offset_contours(contours, -(2 * std::int64_t{wall} + 1) * parameters.wall_width / 2);
    if (!moved) return moved.error();
    if (moved->size() == 0) break;  // and so are all further in
    append_closed(*moved, wall == 0 ? PathKind::kOuter : PathKind::kInner, parameters.wall_width, out);
  }
  if (parameters.pattern == Pattern::kNone) return {};
  auto region = fill_region(contours, context, parameters);
  if (!region) return region.error();
  if (region->size() == 0) return {};
  if (parameters.pattern == Pattern::kContour || parameters.pattern == Pattern::kContourRaster) {
    const auto distance = one_distance(context, parameters);
    if (!distance) return distance.error();
    const bool all = parameters.pattern == Pattern::kContour;
    if (auto status = append_curves(*region, parameters, *distance, all ? UINT32_MAX : parameters.loops, out); !status) {
      return status;
    }
    if (all) return {};
  }
  return append_lines(*region, context, parameters, out);
}

}  // namespace lamina::infill
