#include "tests/raster/reference.h"

#include <map>
#include <vector>

namespace lamina::test {
namespace {

using Int128 = __int128;

/// Whether the point in which edge p -> q meets height z has y <= row_y: p.y + (q.y - p.y) (z - p.z) / (q.z - p.z).
bool end_is_at_or_before(const Point3& p, const Point3& q, Int128 z, Int128 row_y) {
  Int128 left = (Int128{q.y} - p.y) * (z - p.z);
  Int128 right = (row_y - p.y) * (Int128{q.z} - p.z);
  if (q.z < p.z) left = -left, right = -right;
  return left <= right;
}

/// The plane equation of the triangle at a point; zero in the plane, positive on the side of its normal.
Int128 plane_side(const Triangle& t, Int128 x, Int128 y, Int128 z) {
  const Int128 ux = Int128{t.b.x} - t.a.x, uy = Int128{t.b.y} - t.a.y, uz = Int128{t.b.z} - t.a.z;
  const Int128 vx = Int128{t.c.x} - t.a.x, vy = Int128{t.c.y} - t.a.y, vz = Int128{t.c.z} - t.a.z;
  return (uy * vz - uz * vy) * (x - t.a.x) + (uz * vx - ux * vz) * (y - t.a.y) + (ux * vy - uy * vx) * (z - t.a.z);
}

}  // namespace

Runs reference_layer(std::span<const Triangle> triangles, const PixelGrid& grid, Nm plane, FillRule rule) {
  const std::int64_t columns = grid.columns(), rows = grid.rows();
  const auto centre = [](const PixelAxis& axis, std::int64_t i) { return ((2 * i + 1) * axis.span) / (2 * axis.dots); };
  std::vector<std::map<std::int64_t, int>> steps(static_cast<std::size_t>(rows));  // column -> change of winding
  for (Triangle t : triangles) {
    for (Point3* p : {&t.a, &t.b, &t.c}) {  // up to 100 nm above the plane is in it
      if (p->z > plane && std::int64_t{p->z} - plane <= 100) p->z = plane;
    }
    const Point3 corner[3] = {t.a, t.b, t.c};
    std::vector<std::pair<Point3, Point3>> cut;  // edges that the plane crosses
    for (int k = 0; k < 3; ++k) {
      const Point3 &p = corner[k], &q = corner[(k + 1) % 3];
      if ((p.z <= plane) != (q.z <= plane)) cut.emplace_back(p, q);
    }
    if (cut.empty()) continue;
    const std::int64_t lo = std::min({t.a.y, t.b.y, t.c.y}), hi = std::max({t.a.y, t.b.y, t.c.y});
    // Rows outside of the facet's own box cannot be crossed; estimated generously.
    const std::int64_t first = std::max<std::int64_t>(0, lo * grid.y.dots / grid.y.span - 3);
    const std::int64_t last = std::min<std::int64_t>(rows, hi * grid.y.dots / grid.y.span + 3);
    for (std::int64_t row = first; row < last; ++row) {
      const std::int64_t y = centre(grid.y, row);
      if (end_is_at_or_before(cut[0].first, cut[0].second, plane, y) ==
          end_is_at_or_before(cut[1].first, cut[1].second, plane, y)) {
        continue;
      }
      // The side of the facet's normal is outside; along +x, the sign at the far right gives the direction.
      const bool leaves = plane_side(t, Int128{1} << 40, y, plane) > 0;
      std::int64_t below = -1, at = columns;  // crossing is right of centre `below`, left of or on centre `at`
      while (at - below > 1) {
        const std::int64_t middle = (below + at) / 2;
        const Int128 side = plane_side(t, centre(grid.x, middle), y, plane);
        (leaves ? side >= 0 : side <= 0) ? at = middle : below = middle;
      }
      steps[static_cast<std::size_t>(row)][at] += leaves ? -1 : 1;
    }
  }
  Runs runs;
  runs.columns = grid.columns();
  runs.row_offset.push_back(0);
  for (std::int64_t row = rows; row-- > 0;) {
    int winding = 0;
    bool solid = false;
    for (const auto& [column, step] : steps[static_cast<std::size_t>(row)]) {
      winding += step;
      const bool now = rule == FillRule::kNonzero ? winding != 0 : rule == FillRule::kPositive ? winding > 0 : winding % 2 != 0;
      if (now != solid) runs.change.push_back(static_cast<std::uint32_t>(column));
      solid = now;
    }
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

}  // namespace lamina::test
