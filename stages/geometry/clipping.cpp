#include "stages/geometry/clipping.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <polyclipping/clipper.hpp>
#include <vector>

#include "stages/data/shortage.h"
#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/nest.h"
#include "stages/geometry/contours/simplify.h"

namespace lamina {
namespace {

namespace clip = ClipperLib;

constexpr double kArcTolerance = 1000;  // nm

Point2 middle_of(const ContoursView& contours) {
  if (contours.point.empty()) return {0, 0};
  Point2 lo = contours.point.front(), hi = lo;
  for (const Point2 p : contours.point) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
  }
  const auto middle = [](Nm a, Nm b) { return static_cast<Nm>(floor_div<std::int64_t>(std::int64_t{a} + b, 2)); };
  return {middle(lo.x, hi.x), middle(lo.y, hi.y)};
}

/// Clipper is fastest on numbers below 2^30: contours are moved to the origin and back. So results move with the contours.
clip::Paths to_clipper(const ContoursView& contours, Point2 by) {
  clip::Paths paths(contours.size());
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    paths[c].reserve(contours[c].size());
    for (const Point2 p : contours[c]) paths[c].emplace_back(std::int64_t{p.x} - by.x, std::int64_t{p.y} - by.y);
  }
  return paths;
}

Nm within_reach(std::int64_t v) { return static_cast<Nm>(std::clamp<std::int64_t>(v, -kNmReach, kNmReach)); }

/// A contour or a line, but none of fewer points than `needed`.
void append_path(const clip::Path& path, std::size_t needed, Point2 by, Contours& out) {
  if (path.size() < needed) return;
  for (const clip::IntPoint& p : path) out.point.push_back({within_reach(p.X + by.x), within_reach(p.Y + by.y)});
  out.close();
}

/// Each outer contour, then its holes, then what lies in them.
void append_tree(const clip::PolyNode& node, Point2 by, Contours& out) {
  for (const clip::PolyNode* outer : node.Childs) {
    append_path(outer->Contour, 3, by, out);
    for (const clip::PolyNode* hole : outer->Childs) append_path(hole->Contour, 3, by, out);
    for (const clip::PolyNode* hole : outer->Childs) append_tree(*hole, by, out);
  }
}

Error refusal(const char* why) {
  return {Fault::kInternal, fmt::format("contours of a layer cannot be combined: {}; please report this with the part", why)};
}

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
    status = is_shortage(exception) ? out_of_memory() : refusal(exception.what());
  }
  if (refused_allocations() != before) return out_of_memory();
  if (!status) return status.error();
  return out;
}

constexpr const char* kFailed = "a difference or intersection failed";

/// failure  what the error says
Result<Contours> combine(const ContoursView& contours, const ContoursView& with, clip::ClipType how,
                         clip::PolyFillType rule = clip::pftNonZero, const char* failure = kFailed, bool simple = true) {
  if (contours.size() == 0) return Contours();
  return guarded([&](Contours& out) -> Status {
    const Point2 by = middle_of(contours);
    clip::Clipper clipper(simple ? clip::ioStrictlySimple : 0);
    // Contours that are points or lines are not taken; without any, Clipper fails.
    if (!clipper.AddPaths(to_clipper(contours, by), clip::ptSubject, true)) return {};
    clipper.AddPaths(to_clipper(with, by), clip::ptClip, true);
    clip::PolyTree tree;
    if (!clipper.Execute(how, tree, rule, rule)) return refusal(failure);
    append_tree(tree, by, out);
    return {};
  });
}

/// The region that curves, which may cross themselves, go round counter-clockwise more often than clockwise. As contour_union
/// in less time, but contours of the result may touch at corners.
Result<Contours> curve_union(const ContoursView& curves) {
  return guarded([&](Contours& out) -> Status {
    const Point2 by = middle_of(curves);
    clip::Clipper clipper;
    bool any = false;
    for (const clip::Path& path : to_clipper(curves, by)) any |= clipper.AddPath(path, clip::ptSubject, true);
    if (!any) return {};  // all of them shrank to points or lines, which Clipper does not take
    clip::PolyTree tree;
    if (!clipper.Execute(clip::ctUnion, tree, clip::pftPositive, clip::pftPositive)) return refusal("the offset failed");
    append_tree(tree, by, out);
    return {};
  });
}

// --- contours grown or shrunk, with mitered corners
//
//   contours ─> curves ─> tidy ─> find_contacts ─> nest ─> contours
//                 └─────────────────┴─> curve_union, of those with loops or in contact
//
// A curve is what the edges of a contour become when each moves along its normal. Curves without loops that keep clear of each
// other and of themselves are the result; boolean operations are made only where edges vanish on the way, or the region
// divides, merges or vanishes.

constexpr double kSharpest = 0.5;  // 1 + cosine of a turn whose miter is twice the distance from the corner

/// Only the way is rounded: curves of contours that are moved are the same, moved.
void put(Point2 at, double x, double y, Contours& to) {
  constexpr double kFar = 2.0 * kNmReach;
  const auto moved = [&](Nm from, double by) {
    return within_reach(from + static_cast<std::int64_t>(std::nearbyint(std::clamp(by, -kFar, kFar))));
  };
  to.point.push_back({moved(at.x, x), moved(at.y, y)});
}

/// Moves contours by one distance, piece by piece. Buffers are reused.
class Offset {
 public:
  /// distance  nm to the right of the edges: outwards
  explicit Offset(double distance) : distance_(distance) {}

  /// Appends the region of contours [begin, end), whose curves meet those of no other contour. clean  so are the contours
  Status append_piece(const ContoursView& contours, std::uint32_t begin, std::uint32_t end, bool clean, Contours& out);

 private:
  struct OffsetEdge {
    double nx, ny, length;  // unit normal to the right
    Point2 end;
  };

  bool corner(const OffsetEdge& in, const OffsetEdge& out, Contours& to) const;
  bool append_curve(std::span<const Point2> points);

  double distance_;
  std::vector<OffsetEdge> edges_;
  Contours curves_;
  ContactScratch contact_;
  Buffer<std::uint32_t> group_;
};

/// Puts what the corner between two edges becomes. returns  false for a loop
bool Offset::corner(const OffsetEdge& in, const OffsetEdge& out, Contours& to) const {
  const double sine = in.nx * out.ny - in.ny * out.nx, cosine = in.nx * out.nx + in.ny * out.ny;
  const bool opens = sine * distance_ >= 0;
  const double reach = std::abs(distance_ * sine) / (1 + cosine);  // along both edges, from the corner
  if (opens ? 1 + cosine >= kSharpest : cosine > -0.5 && reach <= 0.5 * std::min(in.length, out.length)) {
    const double share = distance_ / (1 + cosine);
    put(in.end, (in.nx + out.nx) * share, (in.ny + out.ny) * share, to);
    return true;
  }
  if (opens) {  // cut off square at the distance
    const double cut = std::tan(std::atan2(sine, cosine) / 4) * distance_;
    put(in.end, distance_ * in.nx - cut * in.ny, distance_ * in.ny + cut * in.nx, to);
    put(in.end, distance_ * out.nx + cut * out.ny, distance_ * out.ny - cut * out.nx, to);
    return true;
  }
  put(in.end, distance_ * in.nx, distance_ * in.ny, to);
  put(in.end, 0, 0, to);
  put(in.end, distance_ * out.nx, distance_ * out.ny, to);
  return false;
}

/// Appends the curve of a closed contour as one contour: what it goes round once is the region, the contour's solid being on
/// the left. A corner that closes is one point if its edges are long enough, else a loop by way of the contour's corner.
/// returns  whether there is no such loop
bool Offset::append_curve(std::span<const Point2> points) {
  edges_.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point2 a = points[i], b = points[i + 1 < points.size() ? i + 1 : 0];
    const double dx = static_cast<double>(b.x) - a.x, dy = static_cast<double>(b.y) - a.y;
    const double length = std::sqrt(dx * dx + dy * dy);
    if (length > 0) edges_.push_back({dy / length, -dx / length, length, b});
  }
  bool plain = true;
  for (std::size_t i = 0; i < edges_.size(); ++i)
    plain &= corner(edges_[i], edges_[i + 1 < edges_.size() ? i + 1 : 0], curves_);
  curves_.close();
  return plain;
}

Status Offset::append_piece(const ContoursView& contours, std::uint32_t begin, std::uint32_t end, bool clean, Contours& out) {
  curves_.clear();
  bool plain = clean;
  for (std::uint32_t c = begin; c < end; ++c) plain &= append_curve(contours[c]);
  if (plain) tidy(curves_);
  if (!plain || find_contacts(curves_, contact_, group_)) {
    const auto merged = curve_union(curves_);
    if (!merged) return merged.error();
    out.append(*merged);
    return {};
  }
  group_.clear();
  if (const auto nested = nest(curves_, FillRule::kPositive, group_); !nested) return nested.error();
  order_by_outer(curves_);
  out.append(curves_);
  return {};
}

}  // namespace

Result<Contours> contour_union(const ContoursView& contours, FillRule rule, bool simple) {
  const clip::PolyFillType type = rule == FillRule::kEvenOdd    ? clip::pftEvenOdd
                                  : rule == FillRule::kPositive ? clip::pftPositive
                                                                : clip::pftNonZero;
  auto region = combine(contours, {}, clip::ctUnion, type, "the union failed", simple);
  if (!region || rule != FillRule::kEvenOdd) return region;
  // By even-odd, Clipper turns some of the contours the wrong way where edges of its input coincide. Edges of a region do not.
  return combine(*region, {}, clip::ctUnion, type, "the union failed", simple);
}

Result<Contours> subtract_contours(const ContoursView& contours, const ContoursView& less, bool simple) {
  return combine(contours, less, clip::ctDifference, clip::pftNonZero, kFailed, simple);
}

Result<Contours> intersect_contours(const ContoursView& one, const ContoursView& other, bool simple) {
  return combine(one, other, clip::ctIntersection, clip::pftNonZero, kFailed, simple);
}

Result<Contours> offset_contours(const ContoursView& contours, std::int64_t distance) {
  Offset offset(static_cast<double>(distance));
  Contours out;
  const bool ordered = is_ordered_by_outer(contours);
  for (std::uint32_t begin = 0, end = 0; begin < contours.size(); begin = end) {
    // Outer contours that shrink, each with its holes, stay apart.
    end = distance < 0 && ordered ? begin + 1 : contours.size();
    while (end < contours.size() && doubled_area(contours[end]) < 0) ++end;
    if (Status status = offset.append_piece(contours, begin, end, ordered, out); !status) return status.error();
  }
  return out;
}

Result<Contours> clip_lines(const ContoursView& lines, const ContoursView& region) {
  if (lines.size() == 0 || region.size() == 0) return Contours();
  return guarded([&](Contours& out) -> Status {
    const Point2 by = middle_of(region);
    clip::Clipper clipper;
    clipper.AddPaths(to_clipper(lines, by), clip::ptSubject, false);
    clipper.AddPaths(to_clipper(region, by), clip::ptClip, true);
    clip::PolyTree tree;
    if (!clipper.Execute(clip::ctIntersection, tree, clip::pftNonZero, clip::pftNonZero)) {
      return refusal("the intersection failed");
    }
    for (const clip::PolyNode* child : tree.Childs) append_path(child->Contour, 2, by, out);
    return {};
  });
}

Result<Contours> cover_lines(const ContoursView& lines, Nm width) {
  if (lines.size() == 0) return Contours();
  return guarded([&](Contours& out) -> Status {
    const Point2 by = middle_of(lines);
    clip::ClipperOffset offsetter(2.0, kArcTolerance);
    offsetter.AddPaths(to_clipper(lines, by), clip::jtRound, clip::etOpenRound);
    clip::PolyTree tree;
    offsetter.Execute(tree, static_cast<double>(width) / 2);
    append_tree(tree, by, out);
    return {};
  });
}

}  // namespace lamina
