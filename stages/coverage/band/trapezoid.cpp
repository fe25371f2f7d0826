#include "stages/coverage/band/trapezoid.h"

#include <algorithm>
#include <cmath>

namespace lamina::coverage {
namespace {

/// By how much a corner may lie off, of the facet's size (docs/coverage.md).
constexpr double kCornerMargin = 0x1p-48;

/// One of two ways along the border, from the highest corner downwards.
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
  const auto append = [&] {
    piece.first_row = rows.at(piece.from_y + piece.low - kSlack);
    piece.last_row = rows.at(piece.from_y + piece.high + kSlack);
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
