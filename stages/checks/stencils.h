// stages/checks/stencils.h: eight-sided discs of pixels, one for each width up to a least one.
//
// Each is the one before it, laid side by side with itself one pixel to the right, down, both, or right and up. So each is made
// of copies of all narrower ones, and what a wide one covers they cover too: whatever is thin for a width is so for wider ones.
//
// Source: sizes of what is opened, G. Matheron, Random Sets and Integral Geometry, Wiley 1975, chapter 1.5; polygons as sums of
// segments, P. Soille, Morphological Image Analysis, 2nd ed., Springer 2003, chapter 3.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/grid.h"

namespace lamina::inspect {

/// Columns of each of its rows, ends included, counted from its left and its top.
struct Stencil {
  struct Row {
    std::uint32_t first = 0, last = 0;
  };
  std::uint32_t columns = 0;  // rows are rows.size()
  std::vector<Row> rows;
};

class Stencils {
 public:
  /// The last one is just as wide and as high as a square of `least_nm`, in whole pixels upwards, or does not fit into the
  /// image. least_nm  0 .. kNmReach; 0: there is only the first one, of one pixel
  Stencils(const PixelGrid& grid, std::int64_t least_nm);

  std::uint32_t count() const { return static_cast<std::uint32_t>(sums_.size()); }
  /// By width; the first is one pixel, the second at least two in one direction.
  Stencil at(std::uint32_t number) const;
  /// Pixels of two squares of its width.
  std::uint64_t two_squares(std::uint32_t number) const;

 private:
  /// Steps of each direction since the first one.
  struct Sum {
    std::uint32_t right = 0, down = 0, falling = 0, rising = 0;
    std::uint32_t columns() const { return 1 + right + falling + rising; }
    std::uint32_t rows() const { return 1 + down + falling + rising; }
  };
  std::vector<Sum> sums_;
};

}  // namespace lamina::inspect
