#include "stages/geometry/contours/offset.h"

#include <algorithm>
#include <cmath>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/nest.h"
#include "stages/geometry/contours/simplify.h"

namespace lamina {
namespace {

/// Buffers of offset_mitered, reused from piece to piece.
struct OffsetScratch {
  Contours curves;
  ContactScratch contact;
  Buffer<std::uint32_t> group;
};

/// Appends the region of contours [begin, end), whose curves meet those of no other contour. clean  so are the contours
Status append_piece(const ContoursView& contours, std::uint32_t begin, std::uint32_t end, bool clean, OffsetCurve& curve,
                    OffsetScratch& scratch, Contours& out) {
  Contours& curves = scratch.curves;
  curves.clear();
  bool plain = clean;
  for (std::uint32_t c = begin; c < end; ++c) plain &= curve.append(contours[c], curves);
  if (plain) tidy(curves);
  if (!plain || find_contacts(curves, scratch.contact, scratch.group)) {
    const auto merged = curve_union(curves);
    if (!merged) return merged.error();
    out.append(*merged);
    return {};
  }
  scratch.group.clear();
  if (const auto nested = nest(curves, FillRule::kPositive, scratch.group); !nested) return nested.error();
  order_by_outer(curves);
  out.append(curves);
  return {};
}

}  // namespace

Result<Contours> offset_mitered(const ContoursView& contours, std::int64_t distance) {
  OffsetCurve curve(static_cast<double>(distance));
  OffsetScratch scratch;
  Contours out;
  const bool ordered = is_ordered_by_outer(contours);
  for (std::uint32_t begin = 0, end = 0; begin < contours.size(); begin = end) {
    // Outer contours that shrink, each with its holes, stay apart.
    end = distance < 0 && ordered ? begin + 1 : contours.size();
    while (end < contours.size() && doubled_area(contours[end]) < 0) ++end;
    if (Status status = append_piece(contours, begin, end, ordered, curve, scratch, out); !status) return status.error();
  }
  return out;
}

namespace {

constexpr double kSharpest = 0.5;  // 1 + cosine of a turn whose miter is twice the distance from the corner

void put(Point2 at, double x, double y, Contours& to) {
  const auto within_reach = [](double v) {
    return static_cast<Nm>(std::clamp<double>(std::nearbyint(v), -kNmReach, kNmReach));
  };
  to.point.push_back({within_reach(at.x + x), within_reach(at.y + y)});
}

}  // namespace

/// Puts what the corner between two edges becomes. returns  false for a loop
bool OffsetCurve::corner(const OffsetEdge& in, const OffsetEdge& out, Contours& to) const {
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

bool OffsetCurve::append(std::span<const Point2> points, Contours& out) {
  edges_.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point2 a = points[i], b = points[i + 1 < points.size() ? i + 1 : 0];
    const double dx = static_cast<double>(b.x) - a.x, dy = static_cast<double>(b.y) - a.y;
    const double length = std::sqrt(dx * dx + dy * dy);
    if (length > 0) edges_.push_back({dy / length, -dx / length, length, b});
  }
  bool plain = true;
  for (std::size_t i = 0; i < edges_.size(); ++i) plain &= corner(edges_[i], edges_[i + 1 < edges_.size() ? i + 1 : 0], out);
  out.close();
  return plain;
}

}  // namespace lamina
