// stages/pores/least_box.h: the box of least area around pixels; internal to pores.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stages/data/units.h"

namespace lamina::pores {

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
BoxSides least_box(std::span<Pixel> pixels, std::array<Nm, 2> edge);

}  // namespace lamina::pores
