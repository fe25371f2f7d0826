#include "stages/coverage/slab_facet.h"

#include <cmath>

namespace lamina::coverage {
namespace {

/// By how much a corner may lie off, of the facet's size (docs/theory/coverage.md).
constexpr double kCornerMargin = 0x1p-48;

/// One of the two runs of edges along the border, from the highest corner downwards.
struct Way {
  Trapezoid::TrapezoidSide side;
  double end;        // y of the next corner
  std::uint32_t to;  // that corner
};

void take_edge(const SlabFacet& facet, std::uint32_t next, Way& way) {
  const std::uint32_t from = way.to;
  const double fall = facet.y[from] - facet.y[next];
  way.side = {facet.y[from], facet.x[from], facet.z[from], 0, 0};
  way.to = next;
  way.end = std::min(facet.y[next], facet.y[from]);
  if (fall > 0) {
    const double per_y = 1 / fall;
    way.side.dx = (facet.x[from] - facet.x[next]) * per_y;
    way.side.dz = (facet.z[from] - facet.z[next]) * per_y;
  }
}

double x_at(const Trapezoid::TrapezoidSide& side, double y) { return side.x + (y - side.y) * side.dx; }

/// The piece between two sides, which has height.
void bound(const Trapezoid::TrapezoidSide& on, const Trapezoid::TrapezoidSide& back, double low, double high,
           Trapezoid& piece) {
  piece.on = on;
  piece.back = back;
  piece.low = low;
  piece.high = high;
  const double x[] = {x_at(on, low), x_at(on, high), x_at(back, low), x_at(back, high)};
  piece.left = *std::ranges::min_element(x);
  piece.right = *std::ranges::max_element(x);
  piece.slope_margin = kCornerMargin * piece.size * std::max(std::abs(on.dx), std::abs(back.dx));
}

/// All corners lie at one y.
void bound_flat(const SlabFacet& facet, double y, Trapezoid& piece) {
  const auto begin = facet.x.begin(), end = begin + facet.corners;
  piece.on = piece.back = {y, *begin, 0, 0, 0};
  piece.low = piece.high = y;
  piece.left = *std::min_element(begin, end);
  piece.right = *std::max_element(begin, end);
  piece.slope_margin = 0;
}

}  // namespace

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
  out.front = static_cast<double>(depth), out.back = 0;
  for (std::uint32_t i = 0; i < out.corners; ++i) {
    out.x[i] = piece->corner[i].x;
    out.y[i] = piece->corner[i].y;
    out.z[i] = piece->corner[i].z;
    out.front = std::min(out.front, out.y[i]);
    out.back = std::max(out.back, out.y[i]);
  }
  if (out.corners == 0) return false;
  out.area = out.moment = 0;
  for (std::uint32_t k = 1; k + 1 < out.corners && !out.edgewise; ++k) {
    const auto corner = [&](std::uint32_t i) { return Corner<double>{out.x[i], out.y[i], out.z[i]}; };
    const double area = area_along_x(corner(0), corner(k), corner(k + 1));
    out.area += area;
    out.moment += area * (out.x[0] + out.x[k] + out.x[k + 1]) / 3;
  }
  out.piece_count = 0;
  out.find_rows(rows);
  return true;
}

void SlabFacet::find_rows(const Edges& rows) {
  first_row = rows.before(low.y + front - kSlack);
  last_row = rows.behind(low.y + back + kSlack);
}

void SlabFacet::move(const Point3& by, const Edges& rows) {
  for (Point3* p : {&facet.a, &facet.b, &facet.c, &low}) *p = {p->x + by.x, p->y + by.y, p->z + by.z};
  find_rows(rows);
}

void Trapezoid::find_rows(const Edges& rows) {
  first_row = rows.before(from_y + low - kSlack);
  last_row = rows.behind(from_y + high + kSlack);
}

void cut_trapezoids(const SlabFacet& facet, std::uint32_t index, const Edges& rows, Buffer<Trapezoid>& to) {
  const std::uint32_t corners = facet.corners, last = corners - 1;
  std::uint32_t highest = 0;
  for (std::uint32_t i = 1; i < corners; ++i) {
    if (facet.y[i] > facet.y[highest]) highest = i;
  }
  Trapezoid piece;
  piece.from_x = facet.low.x;
  piece.from_y = facet.low.y;
  piece.size = facet.size;
  piece.facet = index;
  piece.edgewise = facet.edgewise;
  piece.suspect = facet.suspect;
  piece.level = facet.facet.a.z == facet.facet.b.z && facet.facet.a.z == facet.facet.c.z;
  const auto append = [&] {
    piece.find_rows(rows);
    to.push_back(piece);
  };
  const std::size_t before = to.size();
  Way on, back;
  on.to = back.to = highest;
  take_edge(facet, highest == last ? 0 : highest + 1, on);
  take_edge(facet, highest == 0 ? last : highest - 1, back);
  double y = facet.y[highest];
  for (std::uint32_t edges = 2;; ++edges) {
    const double stop = std::max(on.end, back.end);
    if (stop < y) {
      bound(on.side, back.side, stop, y, piece);
      append();
      y = stop;
    }
    if (edges >= corners) break;
    if (on.end >= back.end) {
      take_edge(facet, on.to == last ? 0 : on.to + 1, on);
    } else {
      take_edge(facet, back.to == 0 ? last : back.to - 1, back);
    }
  }
  if (to.size() > before) return;
  bound_flat(facet, y, piece);
  append();
}

}  // namespace lamina::coverage
