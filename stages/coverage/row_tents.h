// stages/coverage/row_tents.h: the piece of a facet within a row of voxels, ready to be asked at many columns.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "stages/coverage/slab_facet.h"
#include "stages/coverage/volume.h"

namespace lamina::cover {

/// Two numbers that are worked on at once, on any processor that compilers know.
using Two = double __attribute__((vector_size(16)));

/// Two tents (volume.h) for many columns: quotients are made once, and nothing branches.
struct TentPair {
  Two x0, x1, x2, area, mean, rise, fall;

  TentPair() = default;
  /// Corners in any order.
  TentPair(Two a, Two b, Two c, Two seen_along_x) : area(seen_along_x) {
    const Two low = a < b ? a : b, high = a < b ? b : a;
    x0 = low < c ? low : c;
    x2 = high < c ? c : high;
    const Two inner = high < c ? high : c;
    x1 = low < inner ? inner : low;
    mean = (x0 + x1 + x2) * (1.0 / 3);
    const Two of_rise = (x1 - x0) * (x2 - x0), of_fall = (x2 - x1) * (x2 - x0), none{};
    rise = of_rise > 0 ? area / of_rise : none;
    fall = of_fall > 0 ? area / of_fall : none;
  }
  /// Adds the area before x and the volume behind it.
  void add(double x, Two& covered, Two& behind) const {
    const Two at{x, x}, none{};
    const auto rises = at < x1;
    Two from = rises ? at - x0 : x2 - at;
    from = from > 0 ? from : none;
    const Two part = (rises ? rise : fall) * from * from, base = rises ? none : area;
    covered += base + (rises ? part : -part);
    behind += base * (at - mean) + part * from * (1.0 / 3);
  }
};

/// Triangles that make up the piece; x from the facet's lowest corner.
struct Tents {
  std::array<TentPair, 3> pair;
  std::uint32_t count = 0;

  void add(double x, double& covered, double& behind) const {
    Two area{}, volume{};
    for (std::uint32_t k = 0; k < count; ++k) pair[k].add(x, area, volume);
    covered += area[0] + area[1];
    behind += volume[0] + volume[1];
  }
  /// Volume that lies behind, between two x.
  double between(double left, double right) const {
    Two area{}, volume_left{}, volume_right{};
    for (std::uint32_t k = 0; k < count; ++k) {
      pair[k].add(left, area, volume_left);
      pair[k].add(right, area, volume_right);
    }
    const Two volume = volume_right - volume_left;
    return volume[0] + volume[1];
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
    const auto& corner = piece->corner;
    for (std::uint32_t k = 1; k + 1 < piece->size; k += 2) {
      const std::uint32_t last = k + 2 < piece->size ? k + 2 : k + 1;  // the second one may be no triangle
      pair[count++] =
          TentPair(Two{corner[0].x, corner[0].x}, Two{corner[k].x, corner[k + 1].x}, Two{corner[k + 1].x, corner[last].x},
                   Two{area_along_x(corner[0], corner[k], corner[k + 1]),
                       last == k + 1 ? 0 : area_along_x(corner[0], corner[k + 1], corner[last])});
    }
  }
};

}  // namespace lamina::cover
