// stages/coverage/row_tents.h: the piece of a facet within a row of voxels, ready to be asked at many columns.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "stages/coverage/slab_facet.h"
#include "stages/coverage/volume.h"

namespace lamina::cover {

/// A tent for many columns: quotients are made once.
struct RowTent {
  double x0, x1, x2, area, mean, rise, fall;

  RowTent() = default;
  explicit RowTent(const Tent<double>& t)
      : x0(t.x0),
        x1(t.x1),
        x2(t.x2),
        area(t.area),
        mean(t.mean()),
        rise(area / ((x1 - x0) * (x2 - x0))),
        fall(area / ((x2 - x1) * (x2 - x0))) {}
  /// Adds the area before x and the volume behind it, as Tent does; a quotient by 0 is never used.
  void add(double x, double& covered, double& behind) const {
    if (x <= x0) return;
    if (x < x1) {
      const double d = x - x0, part = rise * d * d;
      covered += part;
      behind += part * d * (1.0 / 3);
      return;
    }
    covered += area;
    behind += area * (x - mean);
    if (x >= x2) return;
    const double d = x2 - x, part = fall * d * d;
    covered -= part;
    behind += part * d * (1.0 / 3);
  }
};

/// Triangles that make up the piece; x from the facet's lowest corner.
struct Tents {
  std::array<RowTent, 6> tent;
  std::uint32_t count = 0;

  void put(double xa, double xb, double xc, double area) {
    Tent<double> one;
    one.x0 = std::min(std::min(xa, xb), xc);
    one.x2 = std::max(std::max(xa, xb), xc);
    one.x1 = std::max(std::min(xa, xb), std::min(std::max(xa, xb), xc));
    one.area = area;
    tent[count++] = RowTent(one);
  }
  void add(double x, double& covered, double& behind) const {
    for (std::uint32_t k = 0; k < count; ++k) tent[k].add(x, covered, behind);
  }

  /// low, high  the row's edges, from the facet's lowest corner
  void cut_out(const SlabFacet& facet, double low, double high) {
    count = 0;
    if (facet.edgewise) return;
    Piece<double> whole, above, within;
    double lowest = facet.y[0], highest = facet.y[0];
    whole.size = facet.corners;
    for (std::uint32_t i = 0; i < facet.corners; ++i) {
      whole.corner[i] = {facet.x[i], facet.y[i], facet.z[i]};
      lowest = std::min(lowest, facet.y[i]);
      highest = std::max(highest, facet.y[i]);
    }
    const Piece<double>* piece = &whole;
    if (lowest < low) {
      cut<&Corner<double>::y, true>(*piece, low, above);
      piece = &above;
    }
    if (highest > high) {
      cut<&Corner<double>::y, false>(*piece, high, within);
      piece = &within;
    }
    for (std::uint32_t k = 1; k + 1 < piece->size; ++k) {
      tent[count++] = RowTent(Tent<double>(piece->corner[0], piece->corner[k], piece->corner[k + 1]));
    }
  }
};

}  // namespace lamina::cover
