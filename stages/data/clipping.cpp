#include "stages/data/clipping.h"

#include <fmt/format.h>

#include <algorithm>
#include <polyclipping/clipper.hpp>

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

/// Each outer contour, then its holes, then what lies in them.
void append_tree(const clip::PolyNode& node, Point2 by, Contours& out) {
  for (const clip::PolyNode* child : node.Childs) {
    if (child->Contour.size() >= 3) {
      for (const clip::IntPoint& p : child->Contour) {
        out.point.push_back({within_reach(p.X + by.x), within_reach(p.Y + by.y)});
      }
      out.close();
    }
    append_tree(*child, by, out);
  }
}

Error refusal(const char* why) {
  return {Fault::kInternal, fmt::format("contours of a layer cannot be combined: {}; please report this with the part", why)};
}

}  // namespace

Result<Contours> unite_contours(const ContoursView& contours, FillRule rule) {
  Contours out;
  if (contours.size() == 0) return out;
  try {
    const Moved moved = to_clipper(contours, middle_of(contours));
    clip::Clipper clipper(clip::ioStrictlySimple);
    clipper.AddPaths(moved.paths, clip::ptSubject, true);
    const clip::PolyFillType type = rule == FillRule::kEvenOdd    ? clip::pftEvenOdd
                                    : rule == FillRule::kPositive ? clip::pftPositive
                                                                  : clip::pftNonZero;
    clip::PolyTree tree;
    if (!clipper.Execute(clip::ctUnion, tree, type, type)) return refusal("the union failed");
    append_tree(tree, moved.by, out);
  } catch (const std::exception& exception) {
    return refusal(exception.what());
  }
  return out;
}

Result<Contours> offset_contours(const ContoursView& contours, std::int64_t distance, OffsetJoin join) {
  Contours out;
  if (contours.size() == 0) return out;
  try {
    const Moved moved = to_clipper(contours, middle_of(contours));
    clip::ClipperOffset offsetter(2.0, kArcTolerance);
    offsetter.AddPaths(moved.paths, join == OffsetJoin::kRound ? clip::jtRound : clip::jtMiter, clip::etClosedPolygon);
    clip::PolyTree tree;
    offsetter.Execute(tree, static_cast<double>(distance));
    append_tree(tree, moved.by, out);
  } catch (const std::exception& exception) {
    return refusal(exception.what());
  }
  return out;
}

Result<Contours> clip_lines(const ContoursView& lines, const ContoursView& region) {
  Contours out;
  if (lines.size() == 0 || region.size() == 0) return out;
  try {
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
  } catch (const std::exception& exception) {
    return refusal(exception.what());
  }
  return out;
}

Result<Contours> cover_lines(const ContoursView& lines, Nm width) {
  Contours out;
  if (lines.size() == 0) return out;
  try {
    const Moved moved = to_clipper(lines, middle_of(lines));
    clip::ClipperOffset offsetter(2.0, kArcTolerance);
    offsetter.AddPaths(moved.paths, clip::jtRound, clip::etOpenRound);
    clip::PolyTree tree;
    offsetter.Execute(tree, static_cast<double>(width) / 2);
    append_tree(tree, moved.by, out);
  } catch (const std::exception& exception) {
    return refusal(exception.what());
  }
  return out;
}

}  // namespace lamina
