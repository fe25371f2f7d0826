#include "stages/coverage/slab_facet.h"

#include <algorithm>

namespace lamina::coverage {

bool take_facet(const Triangle& on_bed, bool suspect, std::int64_t bottom, std::int64_t top, const Edges& rows,
                SlabFacet& out) {
  const Point3 &a = on_bed.a, &b = on_bed.b, &c = on_bed.c;
  const Nm lowest = std::min({a.z, b.z, c.z}), highest = std::max({a.z, b.z, c.z});
  if (lowest >= top || highest <= bottom) return false;
  const std::int64_t ux = std::int64_t{b.x} - a.x, uy = std::int64_t{b.y} - a.y, uz = std::int64_t{b.z} - a.z;
  const std::int64_t vx = std::int64_t{c.x} - a.x, vy = std::int64_t{c.y} - a.y, vz = std::int64_t{c.z} - a.z;
  out.edgewise = uy * vz == uz * vy;
  out.enters = uy * vz < uz * vy;
  if (out.edgewise && uz * vx == ux * vz && ux * vy == uy * vx) return false;
  out.facet = on_bed;
  out.suspect = suspect;
  const Nm left = std::min({a.x, b.x, c.x}), front = std::min({a.y, b.y, c.y});
  out.low = {left, front, lowest};
  const std::int64_t width = std::int64_t{std::max({a.x, b.x, c.x})} - left;
  const std::int64_t depth = std::int64_t{std::max({a.y, b.y, c.y})} - front;
  out.size = static_cast<Nm>(std::max({width, depth, std::int64_t{highest} - lowest}));

  Piece<double> whole, cut_once, within;
  const auto put = [&](const Point3& p) {
    whole.corner[whole.size++] = {static_cast<double>(p.x - left), static_cast<double>(p.y - front),
                                  static_cast<double>(p.z - lowest)};
  };
  put(a), put(b), put(c);
  const Piece<double>* piece = &whole;
  if (lowest < bottom) {
    cut<&Corner<double>::z, true>(whole, static_cast<double>(bottom - lowest), cut_once);
    piece = &cut_once;
  }
  if (highest > top) {
    cut<&Corner<double>::z, false>(*piece, static_cast<double>(top - lowest), within);
    piece = &within;
  }
  out.corners = std::min<std::uint32_t>(piece->size, 5);
  double first = static_cast<double>(depth), last = 0;
  for (std::uint32_t i = 0; i < out.corners; ++i) {
    out.x[i] = piece->corner[i].x;
    out.y[i] = piece->corner[i].y;
    out.z[i] = piece->corner[i].z;
    first = std::min(first, out.y[i]);
    last = std::max(last, out.y[i]);
  }
  if (out.corners == 0) return false;
  out.first_row = rows.at(front + first - kSlack);
  out.last_row = rows.at(front + last + kSlack);
  return true;
}

double volume_behind(const SlabFacet& facet, double end) {
  double sum = 0;
  const auto corner = [&](std::uint32_t i) { return Corner<double>{facet.x[i], facet.y[i], facet.z[i]}; };
  for (std::uint32_t k = 1; k + 1 < facet.corners; ++k) {
    const Corner<double> a = corner(0), b = corner(k), c = corner(k + 1);
    sum += area_along_x(a, b, c) * (end - facet.low.x - (a.x + b.x + c.x) / 3);
  }
  return sum;
}

}  // namespace lamina::coverage
