#include "stages/infill/density.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/geometry/bead_section.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/simplify.h"
#include "stages/infill/gaps.h"
#include "stages/infill/gyroid.h"
#include "stages/infill/layout.h"
#include "stages/infill/lines.h"
#include "stages/infill/solid.h"

namespace lamina::infill {
namespace {

constexpr Nm kShortestEdge = 50'000;  // as of other fillings: planners of printers look a few dozen moves ahead
constexpr Nm kNoise = 10'000;         // faces that are narrower than twice this come from rounding and simplification

double area_of(const ContoursView& contours) { return square_mm(doubled_area(contours)) * 1e12; }  // nm2

double perimeter_of(const ContoursView& contours) {
  double sum = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 last = contours[c].back();
    for (const Point2 p : contours[c]) {
      sum += std::hypot(static_cast<double>(p.x) - last.x, static_cast<double>(p.y) - last.y);
      last = p;
    }
  }
  return sum;
}

std::int64_t half(double pitch) { return std::llround(pitch / 2); }

/// Sparse lines of a layer: their pitch is that of the nominal thickness, so their width depends on that of the layer.
struct SparseLines {
  double pitch;  // nm, at a density of 1
  Nm width;
};
SparseLines sparse_lines(const FillParameters& parameters, Nm thickness) {
  const double pitch = solid_pitch(parameters, parameters.width, parameters.nominal_thickness);
  const double height = mm(thickness);
  return {pitch, static_cast<Nm>(nm_of(bead_width(pitch * 1e-6 * height, height, parameters.shape)))};
}

/// Lines at (i + 1/2) distances from the middle of the part, which Frame has as its origin, as far as they may meet a region.
LinePositions positions_from_middle(const ContoursView& region, double distance) {
  LinePositions positions;
  if (region.point.empty() || !(distance > 0)) return positions;
  const auto [low, high] = std::ranges::minmax_element(region.point, {}, &Point2::y);
  const auto first = static_cast<std::int64_t>(std::floor(low->y / distance - 0.5));
  const auto last = static_cast<std::int64_t>(std::ceil(high->y / distance - 0.5));
  positions.first_number = static_cast<std::int32_t>(first);
  positions.at.reserve(static_cast<std::size_t>(last - first + 1));
  for (std::int64_t i = first; i <= last; ++i) {
    positions.at.push_back(std::llround((static_cast<double>(i) + 0.5) * distance));
  }
  return positions;
}

/// One set of parallel lines.
struct LineSet {
  double distance;        // nm
  Nm width;               // of beads
  std::int64_t turn = 0;  // of the layer's direction, micro-degrees
  bool fixed = false;     // the direction is the same in all layers
  bool linked = true;
};

FillParameters turned(FillParameters parameters, const LineSet& set) {
  parameters.angle_base += set.turn;
  if (set.fixed) parameters.angle_step = 0;
  parameters.width = set.width;
  parameters.pattern = Pattern::kRaster;
  parameters.fills_corners = set.linked;
  parameters.longest_link = set.linked ? INT64_MAX : 0;  // the formula counts all of them
  return parameters;
}

void append_set(const ContoursView& region, const LineSet& set, const FillContext& context, const FillParameters& parameters,
                Toolpaths& out) {
  if (region.size() == 0) return;
  const FillParameters own = turned(parameters, set);
  const Frame frame = frame_of(context, own);
  const Contours in_frame = frame.to(region);
  append_raster(in_frame, own, positions_from_middle(in_frame, set.distance), frame, out);
}

std::uint64_t crossings_of_set(const ContoursView& region, const LineSet& set, const FillContext& context,
                               const FillParameters& parameters) {
  if (region.size() == 0) return 0;
  const Frame frame = frame_of(context, turned(parameters, set));
  const Contours in_frame = frame.to(region);
  return count_crossings(in_frame, positions_from_middle(in_frame, set.distance));
}

/// The sparse lines of a layer, and whether they begin half a pitch inside of the region.
struct SparseSets {
  std::vector<LineSet> sets;
  bool inset = false;
};
SparseSets sparse_sets(const ContoursView& region, const ContoursView& inset, const SparseLines& lines,
                       const FillParameters& parameters) {
  const double distance = lines.pitch / *parameters.density;
  SparseSets made;
  if (parameters.pattern == Pattern::kGrid) {
    made.sets = {{2 * distance, lines.width, 0, true, false}, {2 * distance, lines.width, kTurn / 4, true, false}};
    return made;
  }
  if (parameters.pattern == Pattern::kRaster) {
    // Links are half of the edge, but for those that few lines lack. Where they would be a good part of the beads, there are
    // none.
    const double length = area_of(region) / distance, links = perimeter_of(inset) / 2;
    if (links < 0.3 * length) {
      made.sets = {{std::max(area_of(inset) / (length - links), lines.pitch), lines.width}};
      made.inset = true;
      return made;
    }
  }
  made.sets = {{distance, lines.width, 0, false, false}};
  return made;
}

/// The gyroid's place: it begins at the corner of the part, turned as the lines of layer 0.
struct GyroidFrame {
  Frame frame;
  GyroidSection section;
};
GyroidFrame gyroid_frame(const SparseLines& lines, const FillContext& context, const FillParameters& parameters) {
  FillParameters fixed = parameters;
  fixed.angle_step = 0;
  const double period = lines.pitch * gyroid_length() / *parameters.density;
  return {frame_of(context, fixed), GyroidSection(std::int64_t{context.layer.plane()} - context.part.lo.z, period)};
}

std::pair<Point2, Point2> corners_of(const ContoursView& region) {
  Point2 low = region.point.front(), high = low;
  for (const Point2 p : region.point) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  return {low, high};
}

/// A piece of a curve within the region.
struct CurvePiece {
  std::int64_t curve;
  Nm begin;
  std::uint32_t index;
};

/// Appends pieces curve by curve, every second one backwards; those that meet end to end are one.
void append_pieces_in_order(const Contours& pieces, const GyroidFrame& gyroid, Nm width, Toolpaths& out) {
  const GyroidSection& section = gyroid.section;
  std::vector<CurvePiece> order;
  order.reserve(pieces.size());
  for (std::uint32_t c = 0; c < pieces.size(); ++c) {
    const auto points = pieces[c];
    order.push_back({section.nearest_curve(points[points.size() / 2]),
                     std::min(section.along(points.front()), section.along(points.back())), c});
  }
  std::ranges::sort(order, {},
                    [](const CurvePiece& p) { return std::tuple(p.curve, p.curve % 2 == 0 ? p.begin : -p.begin, p.index); });
  Point2 last{};
  bool open = false;
  std::int64_t curve = 0;
  for (const CurvePiece& piece : order) {
    const auto points = pieces[piece.index];
    const bool upwards = section.along(points.front()) < section.along(points.back());
    const bool reversed = upwards == (piece.curve % 2 != 0);
    const auto at = [&](std::size_t i) { return points[reversed ? points.size() - 1 - i : i]; };
    const bool continues = open && curve == piece.curve && at(0) == last;
    if (open && !continues) out.close();
    const auto number = static_cast<std::int32_t>(piece.curve);
    for (std::size_t i = continues ? 1 : 0; i < points.size(); ++i)
      out.add(gyroid.frame.from(at(i)), PathKind::kRaster, width, number);
    open = true;
    last = at(points.size() - 1);
    curve = piece.curve;
  }
  if (open) out.close();
}

Status append_gyroid(const ContoursView& region, const SparseLines& lines, const FillContext& context,
                     const FillParameters& parameters, Toolpaths& out) {
  if (region.size() == 0) return {};
  const GyroidFrame gyroid = gyroid_frame(lines, context, parameters);
  const Contours in_frame = gyroid.frame.to(region);
  const auto [low, high] = corners_of(in_frame);
  Contours curves;
  gyroid.section.append_curves(low, high, curves);
  const auto pieces = clip_lines(curves, in_frame);
  if (!pieces) return pieces.error();
  append_pieces_in_order(*pieces, gyroid, lines.width, out);
  return {};
}

}  // namespace

namespace {

/// Adds lines in narrow regions.
void bound_gaps(std::uint64_t points, FillBound& bound) {
  constexpr std::uint64_t kOfSample = 100;  // bytes in a grid and in lines
  bound.points += points;
  bound.paths += points / 2;
  bound.intervals += points;
  bound.scratch_bytes = std::max(bound.scratch_bytes, kOfSample * points);
}

}  // namespace

double solid_pitch(const FillParameters& parameters, Nm width, Nm thickness) {
  return bead_area(mm(width), mm(thickness), parameters.shape) / mm(thickness) * 1e6;
}

namespace {

/// Of gaps between walls: two of them have room in wider ones.
GapWidths gap_widths(const FillParameters& parameters, Nm thickness) {
  const double pitch = solid_pitch(parameters, parameters.wall_width, thickness);
  return {static_cast<Nm>(2 * pitch), min_gap(pitch)};
}

/// Where the centres of solid lines are.
Status inset_solid(const FillContext& context, const FillParameters& parameters, Outlines& outlines) {
  auto centres = offset_contours(outlines.solid, -half(solid_pitch(parameters, parameters.width, context.layer.thickness)));
  if (!centres) return centres.error();
  outlines.solid_centres = std::move(*centres);
  return {};
}

/// Opposite beads of walls may be so near, in pitches: they overlap by a fifth at most.
constexpr double kNearestWalls = 0.8;

/// A wall of a region, and what of the region has no room for the wall on both sides.
struct WallOf {
  Contours centres, narrow;
  std::int64_t half;  // of the width of what is narrow, at most
};
/// inwards  of the centres from the edge
Result<WallOf> wall_of(const ContoursView& region, std::int64_t inwards, double pitch) {
  const std::int64_t apart = std::llround(kNearestWalls * pitch / 2), half = inwards + apart;
  const auto inset = offset_contours(region, -half);
  auto centres = inset ? offset_contours(*inset, apart) : inset;
  auto narrow = centres ? narrow_part(region, *inset, half) : centres;
  if (!narrow) return narrow.error();
  return WallOf{std::move(*centres), std::move(*narrow), half};
}

/// Lines where the part is thinner than two walls, and what is too thin for them.
Status add_thin_walls(const ContoursView& contours, const WallOf& wall, Nm minimum, bool varies_width, Outlines& outlines) {
  if (!varies_width) {
    outlines.lost = bare_islands(contours, static_cast<Nm>(2 * wall.half), {&wall.centres});
    outlines.lost.append(narrow_features(wall.narrow, static_cast<Nm>(2 * wall.half)));
    return {};
  }
  auto lines = gap_lines(wall.narrow, {static_cast<Nm>(2 * wall.half), minimum});
  if (!lines) return lines.error();
  outlines.thin_walls = std::move(*lines);
  const Contours bare = bare_islands(contours, static_cast<Nm>(2 * wall.half), {&wall.centres, &outlines.thin_walls.lines});
  outlines.lost = add_dots(bare, minimum, outlines.thin_walls);
  outlines.lost.append(narrow_features(outlines.thin_walls.left, minimum));
  return {};
}

/// Moves what is narrower than two sparse lines from what is inside the walls to the gaps. errors  kInternal of Clipper
Status take_narrow(double pitch, Contours& inside, Outlines& outlines) {
  const std::int64_t half = std::llround(pitch);
  const auto inset = offset_contours(inside, -half);
  const auto narrow = inset ? narrow_part(inside, *inset, half) : inset;
  if (!narrow) return narrow.error();
  if (narrow->size() == 0) return {};
  auto rest = subtract_contours(inside, *narrow, false);
  if (!rest) return rest.error();
  inside = std::move(*rest);
  outlines.gaps.append(*narrow);
  return {};
}

}  // namespace

Result<Outlines> outlines_by_density(const ContoursView& contours, const FillContext& context,
                                     const FillParameters& parameters) {
  Outlines made;
  MergeScratch scratch;
  const double pitch = solid_pitch(parameters, parameters.wall_width, context.layer.thickness);
  Contours inside;
  for (std::uint32_t wall = 0; wall < parameters.walls; ++wall) {
    const ContoursView around = wall == 0 ? contours : ContoursView(inside);
    auto of = wall_of(around, wall == 0 ? parameters.wall_width / 2 : half(pitch), pitch);
    if (!of) return of.error();
    if (wall == 0) {
      if (Status status = add_thin_walls(around, *of, min_gap(pitch), parameters.varies_width, made); !status)
        return status.error();
    } else {
      made.gaps.append(of->narrow);
    }
    auto next = offset_contours(of->centres, -half(pitch));
    if (!next) return next.error();
    inside = std::move(*next);
    if (of->centres.size() == 0) break;
    made.walls.push_back(std::move(of->centres));
    merge_short_edges(made.walls.back(), kShortestEdge, context.tolerance, scratch);
  }
  const bool solid = *parameters.density >= 1;
  if (parameters.walls == 0) {
    inside.append(contours);
  } else if (!solid) {
    if (Status status = take_narrow(pitch, inside, made); !status) return status.error();
  }
  Contours& all = solid ? made.solid : made.region;
  all = std::move(inside);
  merge_short_edges(all, kShortestEdge, context.tolerance, scratch);
  if (solid) {
    if (Status status = inset_solid(context, parameters, made); !status) return status.error();
  }
  return made;
}

bool has_skin(const FillParameters& parameters, bool up, std::uint32_t layers, std::int64_t between) {
  const std::optional<std::uint32_t>& count = up ? parameters.top_layers : parameters.bottom_layers;
  return count ? layers < *count : between < (up ? parameters.top : parameters.bottom);
}

bool has_skins(const FillParameters& parameters) {
  return parameters.density && *parameters.density < 1 &&
         (has_skin(parameters, true, 0, 0) || has_skin(parameters, false, 0, 0));
}

std::uint32_t skin_layers(const FillParameters& parameters, Nm thickness) {
  if (!has_skins(parameters)) return 0;
  const auto layers = [&](const std::optional<std::uint32_t>& count, Nm of) {
    return count ? *count : static_cast<std::uint32_t>(ceil_div<std::int64_t>(of, std::max<std::int64_t>(thickness, 1)));
  };
  return std::max(layers(parameters.top_layers, parameters.top), layers(parameters.bottom_layers, parameters.bottom));
}

namespace {

/// What is too narrow for sparse lines next to faces is left out: it becomes solid. Further away it stays.
/// near  what is near faces, kNoise inside its edge
Result<Contours> without_narrow(const Contours& sparse, const Contours& near, Nm width) {
  auto wide = offset_contours(sparse, -std::int64_t{width});
  if (wide) wide = offset_contours(*wide, width);
  auto narrow = wide ? subtract_contours(sparse, *wide, false) : std::move(wide);
  if (narrow) narrow = intersect_contours(*narrow, *offset_contours(near, kNoise + 3 * std::int64_t{width}), false);
  if (!narrow) return narrow.error();
  return subtract_contours(sparse, *narrow, false);
}

}  // namespace

Status divide_skins(const ContoursView& covered, const FillContext& context, const FillParameters& parameters,
                    Outlines& outlines) {
  const Contours& all = outlines.region;
  if (doubled_area(covered) == doubled_area(all)) return {};
  auto near = subtract_contours(all, covered, false);
  if (near) near = offset_contours(*near, -kNoise);
  if (!near) return near.error();
  if (near->size() == 0) return {};
  auto sparse = offset_contours(*near, kNoise + parameters.width);
  if (sparse) sparse = subtract_contours(all, *sparse, false);
  if (sparse) sparse = without_narrow(*sparse, *near, parameters.width);
  if (!sparse) return sparse.error();
  auto solid = subtract_contours(all, *sparse, false);
  if (!solid) return solid.error();
  outlines.solid = std::move(*solid);
  outlines.region = std::move(*sparse);
  return inset_solid(context, parameters, outlines);
}

Status append_by_density(const Outlines& outlines, const FillContext& context, const FillParameters& parameters,
                         Toolpaths& out) {
  const Nm thickness = context.layer.thickness;
  // Not as walls, which close.
  append_gap_lines(outlines.thin_walls, mm(thickness), parameters.shape, PathKind::kSolid, out);
  if (outlines.gaps.size() > 0 && parameters.varies_width) {
    const auto lines = gap_lines(outlines.gaps, gap_widths(parameters, thickness));
    if (!lines) return lines.error();
    append_gap_lines(*lines, mm(thickness), parameters.shape, PathKind::kSolid, out);
  }
  if (Status status = append_solid(outlines, context, parameters, out); !status) return status;
  if (outlines.region.size() == 0 || *parameters.density <= 0) return {};
  const SparseLines lines = sparse_lines(parameters, context.layer.thickness);
  if (parameters.pattern == Pattern::kGyroid) return append_gyroid(outlines.region, lines, context, parameters, out);
  Contours inset;
  if (parameters.pattern == Pattern::kRaster) {
    auto moved = offset_contours(outlines.region, -half(lines.pitch));
    if (!moved) return moved.error();
    inset = std::move(*moved);
  }
  const SparseSets sparse = sparse_sets(outlines.region, inset, lines, parameters);
  for (const LineSet& set : sparse.sets) append_set(sparse.inset ? inset : outlines.region, set, context, parameters, out);
  return {};
}

FillBound bound_by_density(const Outlines& outlines, const FillContext& context, const FillParameters& parameters) {
  constexpr std::uint64_t kOfClipper = 400;  // bytes a point, of edges, joins, scan beams and result at once
  FillBound bound;
  const auto add = [&](std::uint64_t crossings, std::uint64_t points) {
    bound.points += crossings + points;
    bound.paths += crossings / 2 + 1;
    bound.intervals += crossings;
    bound.scratch_bytes = std::max(bound.scratch_bytes, 30 * crossings + (24 + kOfClipper) * points);
  };
  const Nm thickness = context.layer.thickness;
  bound_gaps(outlines.thin_walls.lines.point.size(), bound);
  bound_gaps(bound_gap_points(outlines.gaps, gap_widths(parameters, thickness)), bound);
  if (outlines.solid.size() > 0) {
    const SolidBound solid = bound_solid(outlines, context, parameters);
    add(solid.crossings, outlines.solid_centres.point.size());
    bound_gaps(solid.gap_points, bound);
  }
  if (outlines.region.size() == 0 || *parameters.density <= 0) return bound;
  const SparseLines lines = sparse_lines(parameters, context.layer.thickness);
  const std::uint64_t own = outlines.region.point.size();
  if (parameters.pattern == Pattern::kGyroid) {
    const GyroidFrame gyroid = gyroid_frame(lines, context, parameters);
    const auto [low, high] = corners_of(gyroid.frame.to(outlines.region));
    const std::uint64_t points = gyroid.section.count_points(low, high);
    add(2 * own, points);
    bound.scratch_bytes += kOfClipper * own;
    return bound;
  }
  // A sparse raster has at most the lines that it would have without links.
  FillParameters unlinked = parameters;
  if (parameters.pattern == Pattern::kRaster) unlinked.pattern = Pattern::kLines;
  for (const LineSet& set : sparse_sets(outlines.region, {}, lines, unlinked).sets) {
    add(crossings_of_set(outlines.region, set, context, parameters) + 2 * own, own);
  }
  return bound;
}

}  // namespace lamina::infill
