#include "stages/infill/skirt.h"

#include <algorithm>
#include <limits>

namespace lamina::infill {
namespace {

constexpr std::int64_t kMinDistance = kNmPerMm;  // from the box to the edge of a bead

Point2 point(std::int64_t x, std::int64_t y) { return {static_cast<Nm>(x), static_cast<Nm>(y)}; }

/// The rectangle whose sides lie `away` from the box.
void append_loop(const Box& box, std::int64_t away, Contours& out) {
  const std::int64_t x0 = box.lo.x - away, y0 = box.lo.y - away, x1 = box.hi.x + away, y1 = box.hi.y + away;
  for (const Point2 p : {point(x0, y0), point(x1, y0), point(x1, y1), point(x0, y1), point(x0, y0)}) out.point.push_back(p);
  out.close();
}

/// A line along one side of the box, at least `length` long where the bed is.
void append_line(const Box& box, std::int64_t away, std::size_t side, std::int64_t length, Nm width,
                 std::array<std::int64_t, 2> bed, Contours& out) {
  const bool upright = side % 2 == 0;  // left, front, right, back
  const std::int64_t lo = upright ? box.lo.y : box.lo.x, hi = upright ? box.hi.y : box.hi.x;
  const std::int64_t more = std::max<std::int64_t>(0, (length - (hi - lo) + 1) / 2);
  const std::int64_t minimum = width / 2, maximum = bed[upright ? 1 : 0] - width / 2;
  std::int64_t from = std::max(lo - more, minimum);
  const std::int64_t to = std::min(std::max(hi + more, from + length), maximum);  // what one end lacks, the other adds
  from = std::max(std::min(from, to - length), minimum);
  if (to <= from) return;
  const std::int64_t across[4] = {box.lo.x - away, box.lo.y - away, box.hi.x + away, box.hi.y + away};
  for (const std::int64_t along : {from, to}) {
    out.point.push_back(upright ? point(across[side], along) : point(along, across[side]));
  }
  out.close();
}

}  // namespace

Contours skirt_around(const Box& around, const Extruder::Skirt& settings, Nm width, std::array<std::int64_t, 2> bed) {
  Contours out;
  if (settings.loops == 0 || around.empty() || width <= 0) return out;
  const std::int64_t clearance[4] = {around.lo.x, around.lo.y, bed[0] - around.hi.x, bed[1] - around.hi.y};
  const std::int64_t half = width / 2, wanted = nm_of(settings.distance_mm), minimum = nm_of(settings.min_mm);
  const std::int64_t min_clearance = *std::min_element(clearance, clearance + 4);
  if (min_clearance < kMinDistance + width) {
    const auto side = static_cast<std::size_t>(std::max_element(clearance, clearance + 4) - clearance);
    if (clearance[side] < kMinDistance + width) return out;
    append_line(around, std::min(wanted + half, clearance[side] - half), side, minimum, width, bed, out);
    return out;
  }
  // Centres of loops, from the box outwards.
  const std::int64_t first = std::min(wanted + half, min_clearance - half), last = min_clearance - half;
  std::int64_t away = first, length = 0;
  std::uint32_t loops = 0;
  for (;; away += width) {
    length += 2 * (around.width() + around.depth()) + 8 * away;
    ++loops;
    if ((loops >= settings.loops && length >= minimum) || away + width > last) break;
  }
  for (; loops > 0; --loops, away -= width) append_loop(around, away, out);
  return out;
}

}  // namespace lamina::infill
