// stages/data/contours.h: closed curves in one layer, in integer nanometres on the bed.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/units.h"

namespace lamina {

struct Point2 {
  Nm x, y;
  friend bool operator==(const Point2&, const Point2&) = default;
  friend auto operator<=>(const Point2&, const Point2&) = default;
};

/// Borrowed closed contours, as offset + value.
///
/// offset  contours + 1 entries, first 0, last point.size(); contour c owns point[offset[c] .. offset[c + 1])
/// point   nm. The last point of a contour joins the first, which is not repeated; at least three points.
/// Clean contours (stages/slice and stages/infill hand out no others): outer ones run counter-clockwise, those around
/// holes clockwise, so the solid is on the left; they do not cross each other or themselves, and going inwards outer
/// contours and holes alternate; an outer contour is followed by the holes in it. So nonzero, positive and even-odd mean the
/// same region.
struct ContoursView {
  std::span<const std::uint32_t> offset;
  std::span<const Point2> point;

  std::uint32_t size() const { return offset.empty() ? 0 : static_cast<std::uint32_t>(offset.size() - 1); }
  std::span<const Point2> operator[](std::uint32_t c) const { return point.subspan(offset[c], offset[c + 1] - offset[c]); }
};

/// Owned contours; 4 bytes a contour and 8 bytes a point.
struct Contours {
  Buffer<std::uint32_t> offset{0};
  Buffer<Point2> point;

  std::uint32_t size() const { return static_cast<std::uint32_t>(offset.size() - 1); }
  std::span<const Point2> operator[](std::uint32_t c) const { return view()[c]; }
  ContoursView view() const { return {offset, point}; }
  operator ContoursView() const { return view(); }

  void clear() {
    offset.assign(1, 0);
    point.clear();
  }
  void append(const ContoursView& other) {
    const auto base = static_cast<std::uint32_t>(point.size());
    point.insert(point.end(), other.point.begin(), other.point.end());
    for (std::uint32_t c = 0; c < other.size(); ++c) offset.push_back(base + other.offset[c + 1]);
  }
  /// Ends the contour whose points were appended to `point`.
  void close() { offset.push_back(static_cast<std::uint32_t>(point.size())); }
};

/// Twice the signed area, nm^2, exactly: positive for counter-clockwise contours. |result| < 2^66.
inline __int128 doubled_area(std::span<const Point2> contour) {
  __int128 sum = 0;
  if (contour.size() < 3) return sum;
  const Point2 origin = contour.front();
  for (std::size_t i = 1; i + 1 < contour.size(); ++i) {
    const std::int64_t ux = std::int64_t{contour[i].x} - origin.x, uy = std::int64_t{contour[i].y} - origin.y;
    const std::int64_t vx = std::int64_t{contour[i + 1].x} - origin.x, vy = std::int64_t{contour[i + 1].y} - origin.y;
    sum += static_cast<__int128>(ux) * vy - static_cast<__int128>(uy) * vx;
  }
  return sum;
}

/// Twice the area between clean contours, nm^2, exactly.
inline __int128 doubled_area(const ContoursView& contours) {
  __int128 sum = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) sum += doubled_area(contours[c]);
  return sum;
}

/// Square millimetres of a doubled area in nm^2; for reports and flows, never for decisions.
inline double square_mm(__int128 doubled) { return static_cast<double>(doubled) * 0.5e-12; }

}  // namespace lamina
