#include "stages/geometry/clipping.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <polyclipping/clipper.hpp>
#include <vector>

#include "stages/data/shortage.h"
#include "stages/geometry/contours/offset.h"

namespace lamina {
namespace {

namespace clip = ClipperLib;

constexpr double kArcTolerance = 1000;  // nm

/// Clipper is fastest on numbers below 2^30: contours are moved to the origin and back.
struct Moved {
  Point2 by{0, 0};
  clip::Paths paths;
};

Point2 middle_of(const ContoursView& contours) {
  if (contours.point.empty()) return {0, 0};
  Point2 lo = contours.point.front(), hi = lo;
  for (const Point2 p : contours.point) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
  }
  return {static_cast<Nm>((std::int64_t{lo.x} + hi.x) / 2), static_cast<Nm>((std::int64_t{lo.y} + hi.y) / 2)};
}

Moved to_clipper(const ContoursView& contours, Point2 by) {
  Moved moved{by, clip::Paths(contours.size())};
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    moved.paths[c].reserve(contours[c].size());
    for (const Point2 p : contours[c]) moved.paths[c].emplace_back(std::int64_t{p.x} - by.x, std::int64_t{p.y} - by.y);
  }
  return moved;
}

Nm within_reach(std::int64_t v) { return static_cast<Nm>(std::clamp<std::int64_t>(v, -kNmReach, kNmReach)); }

void append_contour(const clip::Path& path, Point2 by, Contours& out) {
  if (path.size() < 3) return;
  for (const clip::IntPoint& p : path) out.point.push_back({within_reach(p.X + by.x), within_reach(p.Y + by.y)});
  out.close();
}

/// Each outer contour, then its holes, then what lies in them.
void append_tree(const clip::PolyNode& node, Point2 by, Contours& out) {
  for (const clip::PolyNode* outer : node.Childs) {
    append_contour(outer->Contour, by, out);
    for (const clip::PolyNode* hole : outer->Childs) append_contour(hole->Contour, by, out);
    for (const clip::PolyNode* hole : outer->Childs) append_tree(*hole, by, out);
  }
}

Error refusal(const char* why) {
  return {Fault::kInternal, fmt::format("contours of a layer cannot be combined: {}; please report this with the part", why)};
}

Error refusal(const std::exception& why) { return is_shortage(why) ? out_of_memory() : refusal(why.what()); }

/// What `act` leaves in `out`. Clipper swallows its own std::bad_alloc, and ClipperOffset then answers with less or nothing: so
/// the result of an act during which memory ran out, in any thread, is discarded.
template <class Act>
Result<Contours> guarded(Act&& act) {
  const std::uint64_t before = refused_allocations();
  Contours out;
  Status status;
  try {
    status = act(out);
  } catch (const std::exception& exception) {
    status = refusal(exception);
  }
  if (refused_allocations() != before) return out_of_memory();
  if (!status) return status.error();
  return out;
}

Result<Contours> combine(const ContoursView& contours, const ContoursView& with, clip::ClipType how) {
  if (contours.size() == 0) return Contours();
  return guarded([&](Contours& out) -> Status {
    const Point2 by = middle_of(contours);
    clip::Clipper clipper(clip::ioStrictlySimple);
    clipper.AddPaths(to_clipper(contours, by).paths, clip::ptSubject, true);
    clipper.AddPaths(to_clipper(with, by).paths, clip::ptClip, true);
    clip::PolyTree tree;
    if (!clipper.Execute(how, tree, clip::pftNonZero, clip::pftNonZero)) {
      return refusal("a difference or intersection failed");
    }
    append_tree(tree, by, out);
    return {};
  });
}

}  // namespace

Result<Contours> contour_union(const ContoursView& contours, FillRule rule) {
  if (contours.size() == 0) return Contours();
  return guarded([&](Contours& out) -> Status {
    const Moved moved = to_clipper(contours, middle_of(contours));
    clip::Clipper clipper(clip::ioStrictlySimple);
    clipper.AddPaths(moved.paths, clip::ptSubject, true);
    const clip::PolyFillType type = rule == FillRule::kEvenOdd    ? clip::pftEvenOdd
                                    : rule == FillRule::kPositive ? clip::pftPositive
                                                                  : clip::pftNonZero;
    clip::PolyTree tree;
    if (!clipper.Execute(clip::ctUnion, tree, type, type)) return refusal("the union failed");
    append_tree(tree, moved.by, out);
    return {};
  });
}

Result<Contours> curve_union(const ContoursView& curves) {
  return guarded([&](Contours& out) -> Status {
    const Moved moved = to_clipper(curves, middle_of(curves));
    clip::Clipper clipper;
    bool any = false;
    for (const clip::Path& path : moved.paths) any |= clipper.AddPath(path, clip::ptSubject, true);
    if (!any) return {};  // all of them shrank to points or lines, which Clipper does not take
    clip::PolyTree tree;
    if (!clipper.Execute(clip::ctUnion, tree, clip::pftPositive, clip::pftPositive)) return refusal("the offset failed");
    append_tree(tree, moved.by, out);
    return {};
  });
}

Result<Contours> subtract_contours(const ContoursView& contours, const ContoursView& less) {
  return combine(contours, less, clip::ctDifference);
}

Result<Contours> intersect_contours(const ContoursView& one, const ContoursView& other) {
  return combine(one, other, clip::ctIntersection);
}

Result<Contours> offset_contours(const ContoursView& contours, std::int64_t distance, OffsetJoin join) {
  if (contours.size() == 0) return Contours();
  if (join == OffsetJoin::kMiter) return offset_mitered(contours, distance);
  return guarded([&](Contours& out) -> Status {
    const Moved moved = to_clipper(contours, middle_of(contours));
    clip::PolyTree tree;
    clip::ClipperOffset offsetter(2.0, kArcTolerance);
    offsetter.AddPaths(moved.paths, clip::jtRound, clip::etClosedPolygon);
    offsetter.Execute(tree, static_cast<double>(distance));
    append_tree(tree, moved.by, out);
    return {};
  });
}

Result<Contours> clip_lines(const ContoursView& lines, const ContoursView& region) {
  if (lines.size() == 0 || region.size() == 0) return Contours();
  return guarded([&](Contours& out) -> Status {
    const Point2 by = middle_of(region);
    clip::Clipper clipper;
    clipper.AddPaths(to_clipper(lines, by).paths, clip::ptSubject, false);
    clipper.AddPaths(to_clipper(region, by).paths, clip::ptClip, true);
    clip::PolyTree tree;
    if (!clipper.Execute(clip::ctIntersection, tree, clip::pftNonZero, clip::pftNonZero)) {
      return refusal("the intersection failed");
    }
    for (const clip::PolyNode* child : tree.Childs) {
      if (child->Contour.size() < 2) continue;
      for (const clip::IntPoint& p : child->Contour) out.point.push_back({within_reach(p.X + by.x), within_reach(p.Y + by.y)});
      out.close();
    }
    return {};
  });
}

Result<Contours> cover_lines(const ContoursView& lines, Nm width) {
  if (lines.size() == 0) return Contours();
  return guarded([&](Contours& out) -> Status {
    const Moved moved = to_clipper(lines, middle_of(lines));
    clip::ClipperOffset offsetter(2.0, kArcTolerance);
    offsetter.AddPaths(moved.paths, clip::jtRound, clip::etOpenRound);
    clip::PolyTree tree;
    offsetter.Execute(tree, static_cast<double>(width) / 2);
    append_tree(tree, moved.by, out);
    return {};
  });
}

}  // namespace lamina
