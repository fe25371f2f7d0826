// stages/view/picture/contour_shares.h: how much of each pixel lies within contours.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/contours.h"

namespace lamina::view::picture {

/// Pixels of a panel: x from its left, y from its top, which lie at `left` and `top` nm.
struct Scale {
  double left, top, pixels_per_nm;
  double x(Nm at) const { return (at - left) * pixels_per_nm; }
  double y(Nm at) const { return (top - at) * pixels_per_nm; }
};

/// Shares of 0 .. 255 of a panel of width x height pixels that lie within contours, by the nonzero rule, to 1/8 of a row.
std::vector<std::uint8_t> contour_shares(const ContoursView& contours, const Scale& scale, int width, int height);

}  // namespace lamina::view::picture
