#include "stages/infill/fill.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/simplify.h"
#include "stages/infill/density.h"
#include "stages/infill/layout.h"
#include "stages/infill/lines.h"
#include "stages/infill/seam.h"

namespace lamina::infill {
namespace {

/// Beads below this are of no use: planners of printers use a lookahead of a few dozen moves.
constexpr Nm kShortest = 50'000;

/// Closed paths: the first point comes again at the end.
void append_closed(const ContoursView& contours, PathKind kind, Nm width, Toolpaths& out, std::int32_t number = kNoLine,
                   Seam seam = Seam::kContour) {
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    const auto points = contours[c];
    const std::size_t first = seam_point(points, seam, out.point.empty() ? points.front() : out.point.back());
    for (std::size_t i = 0; i <= points.size(); ++i) out.add(points[(first + i) % points.size()], kind, width, number);
    out.close();
  }
}

Status append_lines(const ContoursView& region, const FillContext& context, const FillParameters& parameters, Toolpaths& out) {
  const Frame frame = frame_of(context, parameters);
  const Contours turned = frame.to(region);
  const auto positions = positions_across(turned, frame, context, parameters);
  if (!positions) return positions.error();
  // Crests are counted from the part's side as well.
  if (is_wave(parameters.pattern)) {
    return append_waves(turned, parameters, *positions, frame.to(context.part).lo.x, frame, out);
  }
  append_raster(turned, parameters, *positions, frame, out);
  return {};
}

/// Closed curves from the edge of the region inwards, numbered as their places: all that fit, or `maximum` of them. Leaves in
/// `region` what the place of the next one encloses.
Status append_curves(Contours& region, const FillContext& context, const FillParameters& parameters, std::uint32_t maximum,
                     Toolpaths& out) {
  if (maximum == 0) return {};
  const auto positions = positions_inwards(region, context, parameters);
  if (!positions) return positions.error();
  const auto depth = region_depth(context, parameters);
  if (!depth) return depth.error();
  std::int64_t at = *depth;
  for (std::size_t k = 0; k < positions->at.size() && region.size() > 0; ++k) {
    if (positions->at[k] != at) {
      auto next = offset_contours(region, at - positions->at[k]);
      if (!next) return next.error();
      region = std::move(*next);
      at = positions->at[k];
    }
    if (k == maximum) return {};
    const std::int32_t number = positions->first_number + static_cast<std::int32_t>(k);
    append_closed(region, PathKind::kContour, parameters.width, out, number);
  }
  region.clear();  // no place is left inside the last curve
  return {};
}

/// Points of the first `curves` closed curves, at most. The region is evaluated in a few depths: from one to the next its
/// corners can only part where one that points inwards meets an edge, so they at most double.
Result<std::uint64_t> bound_curves(const ContoursView& region, const FillContext& context, const FillParameters& parameters,
                                   const LinePositions& positions, std::size_t curves) {
  constexpr std::size_t kDepths = 8, kCurvesADepth = 8;  // so this takes an eighth of the time of the deposit
  const std::size_t step = std::max(kCurvesADepth, (curves + kDepths - 1) / kDepths);
  const auto depth = region_depth(context, parameters);
  if (!depth) return depth.error();
  std::uint64_t total = 0;
  Contours inner;
  for (std::size_t k = 0; k < curves; k += step) {
    ContoursView here = region;
    if (k > 0) {
      auto next = offset_contours(k == step ? region : ContoursView(inner),
                                  (k == step ? *depth : positions.at[k - step]) - positions.at[k]);
      if (!next) return next.error();
      inner = std::move(*next);
      here = inner;
    }
    if (here.size() == 0) break;
    total += std::min(step, curves - k) * (2 * std::uint64_t{here.point.size()} + here.size());
  }
  return total;
}

}  // namespace

namespace {

/// errors  kUsage: a pattern and a density that exclude each other
Status check_density(const FillParameters& parameters) {
  if (!parameters.density) {
    if (!needs_density(parameters.pattern)) return {};
    return Error{Fault::kUsage, "lines, grid and gyroid are spaced by a density; give --density, or choose raster"};
  }
  if (!(*parameters.density >= 0 && *parameters.density <= 1)) {
    return Error{Fault::kUsage, fmt::format("a density of {} %; it has to be 0 to 100", *parameters.density * 100)};
  }
  if (parameters.group > 1 || parameters.stagger != std::vector<Nm>{0} || parameters.first_line || parameters.end_inset ||
      parameters.longest_link >= 0) {
    return Error{
        Fault::kUsage,
        "a density decides where lines are; leave out groups, staggers, first lines, end insets and links, or the density"};
  }
  if (needs_density(parameters.pattern) || parameters.pattern == Pattern::kRaster) return {};
  if (parameters.pattern == Pattern::kNone) {
    return Error{Fault::kUsage, "a density needs a pattern; add lines, grid, gyroid or raster"};
  }
  return Error{Fault::kUsage, "a density spaces lines, grid, gyroid and raster; other patterns take gaps"};
}

}  // namespace

Status check(const FillParameters& parameters) {
  const auto wrong = [](const std::string& what) { return Error{Fault::kUsage, what}; };
  if (Status status = check_density(parameters); !status) return status;
  if (parameters.width <= 0) return wrong("the bead width has to be above 0");
  if (parameters.walls > 0 && parameters.wall_width <= 0) return wrong("the wall's bead width has to be above 0");
  if (parameters.build_layers == 0) return wrong("the number of layers with one angle has to be 1 or more");
  if (parameters.group == 0) return wrong("the number of beads in a group has to be 1 or more");
  if (parameters.gaps.empty()) return wrong("no gap is given; 0 deposits adjacent beads");
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
        return wrong(fmt::format("a gap of {} mm at {} mm with beads of {} mm leaves nothing from line to line", mm(gap), mm(z),
                                 mm(parameters.width)));
      }
    }
  }
  if (!parameters.gap_expression.empty()) {
    const auto parsed = Expression::parse(parameters.gap_expression);
    if (!parsed) return parsed.error();
    const bool curves = parameters.pattern == Pattern::kContour || parameters.pattern == Pattern::kContourRaster;
    if (curves && parsed->uses("u")) {
      return wrong(
          fmt::format("'{}': closed curves have no extent across, so u means nothing to them; use s, their depth in "
                      "mm, or i",
                      parameters.gap_expression));
    }
  }
  if (parameters.cell <= 0) return wrong("cells have to be wider than 0");
  return {};
}

Result<Outlines> outlines_of(const ContoursView& contours, const FillContext& context, const FillParameters& parameters) {
  if (parameters.density) return outlines_by_density(contours, context, parameters);
  Outlines made;
  MergeScratch scratch;
  Contours innermost;  // with all its points: what merging moves does not add up
  ContoursView from = contours;
  std::int64_t at = 0;
  for (std::uint32_t wall = 0; wall < parameters.walls; ++wall) {
    const std::int64_t centre = (2 * std::int64_t{wall} + 1) * parameters.wall_width / 2;
    auto moved = offset_contours(from, at - centre);
    if (!moved) return moved.error();
    if (wall == 0) {
      const auto thin = narrow_part(contours, *moved, parameters.wall_width / 2);
      if (!thin) return thin.error();
      made.lost = bare_islands(contours, parameters.wall_width, {&*moved});
      made.lost.append(narrow_features(*thin, parameters.wall_width));
    }
    if (moved->size() == 0) break;  // and so are all further in
    innermost = std::move(*moved);
    from = innermost;
    at = centre;
    made.walls.push_back(innermost);
    merge_short_edges(made.walls.back(), kShortest, context.tolerance, scratch);
  }
  if (parameters.pattern == Pattern::kNone) return made;
  const auto depth = region_depth(context, parameters);
  if (!depth) return depth.error();
  if (*depth < at) from = contours, at = 0;
  auto region = offset_contours(from, at - *depth);
  if (!region) return region.error();
  made.region = std::move(*region);
  merge_short_edges(made.region, kShortest, context.tolerance, scratch);
  return made;
}

Result<FillBound> bound_fill(const ContoursView& contours, const Outlines& outlines, const FillContext& context,
                             const FillParameters& parameters) {
  const ContoursView region = outlines.region;
  // Clipper takes an offset's or a line's points as edges, joins, scan beams and result at once.
  constexpr std::uint64_t kOfClipper = 400;
  const std::uint64_t surface = contours.point.size(), own = region.point.size();
  FillBound bound;
  bound.points = parameters.walls * (2 * surface + contours.size());
  bound.paths = bound.intervals = bound.points / 4;  // a closed path has three corners or more, and its first one again
  if (parameters.walls > 0) bound.scratch_bytes = kOfClipper * surface;
  if (parameters.density) {
    const FillBound inside = bound_by_density(outlines, context, parameters);
    bound.points += inside.points;
    bound.paths += inside.paths;
    bound.intervals += inside.intervals;
    bound.scratch_bytes += inside.scratch_bytes;
    return bound;
  }
  if (region.size() == 0) return bound;
  if (parameters.pattern == Pattern::kContour || parameters.pattern == Pattern::kContourRaster) {
    const auto positions = positions_inwards(region, context, parameters);
    if (!positions) return positions.error();
    std::size_t curves = positions->at.size();
    if (parameters.pattern == Pattern::kContourRaster) curves = std::min<std::size_t>(curves, parameters.loops);
    const auto points = bound_curves(region, context, parameters, *positions, curves);
    if (!points) return points.error();
    bound.points += *points;
    bound.paths = bound.intervals = bound.points / 4;
    bound.scratch_bytes += kOfClipper * 2 * own;
    if (parameters.pattern == Pattern::kContour) return bound;
  }
  const Frame frame = frame_of(context, parameters);
  const Contours turned = frame.to(region);
  const auto positions = positions_across(turned, frame, context, parameters);
  if (!positions) return positions.error();
  if (is_wave(parameters.pattern)) {
    const WaveBound waves = bound_waves(turned, parameters, *positions);
    bound.points += waves.points;
    bound.paths += waves.pieces;
    bound.intervals += waves.pieces;
    bound.scratch_bytes += kOfClipper * (own + waves.at_once);
  } else {
    const std::uint64_t crossings = count_crossings(turned, *positions);
    bound.points += crossings + own;
    bound.paths += crossings / 2;  // a line ends at two of them
    bound.intervals += crossings;  // lines, and links between them
    bound.scratch_bytes += 30 * crossings + 24 * own + 24 * positions->at.size();
  }
  return bound;
}

Status append_fill(Outlines outlines, const FillContext& context, const FillParameters& parameters, Toolpaths& out) {
  for (std::size_t wall = 0; wall < outlines.walls.size(); ++wall) {
    append_closed(outlines.walls[wall], wall == 0 ? PathKind::kOuter : PathKind::kInner, parameters.wall_width, out, kNoLine,
                  parameters.seam);
  }
  if (parameters.density) return append_by_density(outlines, context, parameters, out);
  Contours& region = outlines.region;
  if (region.size() == 0) return {};
  if (parameters.pattern == Pattern::kContour) return append_curves(region, context, parameters, UINT32_MAX, out);
  if (parameters.pattern == Pattern::kContourRaster) {
    if (Status status = append_curves(region, context, parameters, parameters.loops, out); !status) return status;
    if (region.size() == 0) return {};
  }
  return append_lines(region, context, parameters, out);
}

}  // namespace lamina::infill
