// stages/arrange/silhouette.h: what of the bed a part covers from above, as rows of bits.
//
// A cell is set if the shadow of the part may reach into it, so shapes that share no cell do not overlap.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/data/units.h"

namespace lamina::arrange {

/// Rows of cells, from the front; 64 cells of a row a word, the left one in the lowest bit.
struct BitShape {
  std::uint32_t width = 0, depth = 0;  // cells
  std::vector<std::uint64_t> bits;     // depth x words

  BitShape() = default;
  BitShape(std::uint32_t w, std::uint32_t d) : width(w), depth(d), bits(std::size_t{d} * ((w + 63) / 64)) {}
  std::uint32_t words() const { return (width + 63) / 64; }
  std::span<std::uint64_t> row(std::uint32_t y) { return std::span(bits).subspan(std::size_t{y} * words(), words()); }
  std::span<const std::uint64_t> row(std::uint32_t y) const {
    return std::span(bits).subspan(std::size_t{y} * words(), words());
  }
  bool at(std::uint32_t x, std::uint32_t y) const { return (row(y)[x / 64] >> (x % 64) & 1) != 0; }
  /// Sets the cells [begin, end) of a row.
  void set(std::uint32_t y, std::uint32_t begin, std::uint32_t end);
  std::uint64_t count() const;
};

/// Calls use(begin, end) for each run of set cells of a row.
template <class Use>
void for_each_run(std::span<const std::uint64_t> row, std::uint32_t width, Use use) {
  std::uint32_t x = 0;
  const auto skip = [&](bool set) {
    while (x < width) {
      const std::uint64_t word = (set ? ~row[x / 64] : row[x / 64]) >> (x % 64);
      if (word != 0) {
        x = std::min(width, x + static_cast<std::uint32_t>(std::countr_zero(word)));
        return;
      }
      x = std::min(width, (x / 64 + 1) * 64);
    }
  };
  for (;;) {
    skip(false);
    if (x >= width) return;
    const std::uint32_t begin = x;
    skip(true);
    use(begin, x);
  }
}

/// A part turned about z and put with the lower corner of its box at the origin. All lengths nm.
struct Shadow {
  std::int64_t width = 0, depth = 0, height = 0;  // of the box
  double area_mm2 = 0;                            // of its cells
  BitShape shape;
};

/// The shadow of instances of meshes.
///
/// meshes  as lists of triangles
/// turn    micro-degrees about z, counter-clockwise; quarter turns are exact
/// cell    nm, > 0
/// phase   nm from the corner of the first cell to that of the box, along x and y, below a cell
/// cost    O(triangles + cells that they cover)
Shadow shadow_of(std::span<const Mesh> meshes, std::span<const Instance> instances, MicroDegrees turn, std::int64_t cell,
                 std::array<std::int64_t, 2> phase = {0, 0});

/// A shape in cells `factor` times as large: set where any of theirs is.
BitShape coarse_shape(const BitShape& shape, std::uint32_t factor);

/// A shape and all cells that may be nearer to it than a gap, in nm: larger by the result's `reach` on each side.
struct GrownShape {
  BitShape shape;
  std::uint32_t reach = 0;  // cells
};
/// cost  O(cells x gap / cell / 64)
GrownShape grown_shape(const BitShape& shape, std::int64_t gap, std::int64_t cell);

}  // namespace lamina::arrange
