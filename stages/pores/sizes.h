// stages/pores/sizes.h: pores as they are seen from above: their lengths and widths, slice by slice.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/units.h"
#include "stages/data/voxels.h"

namespace lamina::pores {

/// A region of void in one slice, of voxels that share a side.
struct Pore {
  double length_mm, width_mm;  // sides of its box, length >= width
  double area_mm2;             // area / length is its mean width
  std::uint32_t slice;
};

/// Pores of all slices, and regions that have no length.
struct PoreSizes {
  Buffer<Pore> pores;         // by slice, then in the order of their first runs
  std::uint64_t cut = 0;      // reach the edge of the box or body
  std::uint64_t endless = 0;  // go around a periodic axis
  double cut_mm2 = 0, endless_mm2 = 0;
  /// Mean widths, area / period, of endless regions that go around one axis only: gaps between straight beads.
  Buffer<double> channels_mm;
};

/// The box of a pore is the one of least area that holds its pixels, in any direction. Rectangles and slots are measured
/// exactly along rows and columns, and a disc by its diameter; turned ones to within about a voxel. A box of equal moments
/// would be as cheap, but takes 13 % off a disc; the largest circle tells nothing of the length. A pore with cusps, as between
/// round ends of beads, is measured from tip to tip, as far as its tips are wider than a voxel.
/// body    void counts within it, and a region beside void outside of it is cut; none: the whole box
/// throws  std::length_error  2^32 changes or more
/// source  Freeman, Shapira, "Determining the minimum-area encasing rectangle for an arbitrary closed curve" (1975)
/// cost    O(runs log runs), slices in parallel, and for each pore the square of the corners of its hull
PoreSizes pore_sizes(const VoxelView& solid, const VoxelView* body = nullptr);

/// Mean, standard deviation (of a sample, n - 1) and histogram.
struct Distribution {
  std::uint64_t count = 0;
  double mean = 0, deviation = 0, minimum = 0, maximum = 0;
  double bin = 0;
  std::vector<std::uint64_t> bins;  // bin i holds i * bin <= value < (i + 1) * bin; the last holds all beyond too
};

/// bin  > 0, in the unit of the values; bins  at least 1
Distribution distribution(std::span<const double> values, double bin, std::uint32_t bins);
Distribution lengths(const PoreSizes& sizes, double bin_mm, std::uint32_t bins);
Distribution widths(const PoreSizes& sizes, double bin_mm, std::uint32_t bins);

// --- the box of least area around pixels; internal to pores.

/// A pixel of an endless plane.
struct Pixel {
  std::int32_t x, y;
  bool operator==(const Pixel&) const = default;
};

struct BoxSides {
  double length, width;  // nm, length >= width
};

/// The box around the pixels' centres, wider by the larger of what a pixel's sides measure in each direction: so rows of pixels
/// and diagonals of them have the length of their line. Two boxes of one area: the narrower one. Mirrored and transposed pixels
/// have the same box, to the last bit.
/// pixels  at least one, any order; they are sorted, and their convex hull is left in front
/// edge    nm, along x and y
BoxSides smallest_box(std::span<Pixel> pixels, std::array<Nm, 2> edge);

}  // namespace lamina::pores
