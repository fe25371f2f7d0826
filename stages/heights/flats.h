// stages/heights/flats.h: the heights at which a layer ought to end.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/heights/surface.h"

namespace lamina::heights {

/// Horizontal faces at one height, or the top or bottom of a part.
struct Flat {
  Nm height;                        // nm above the bed, > 0
  double up_mm2 = 0, down_mm2 = 0;  // of one copy of each part
  bool end = false;                 // top or bottom of a part
  std::uint32_t part = 0;           // the one with the largest area here
};

/// The flats of these parts, in increasing height, none at the bed itself.
///
/// Horizontal facets whose heights lie within `tolerance` count as one flat, at the height that half of their area lies
/// at or below: real meshes wobble. Flats smaller than `min_mm2` are left out. Tops and bottoms of parts belong to the
/// flat within `tolerance` of them, which is then at their very height, or are flats of their own.
///
/// cost  O(f log f) for f horizontal facets
std::vector<Flat> find_flats(const SurfaceIndex& index, Nm tolerance, double min_mm2);

/// How far the nearest of these boundaries is from a height. Boundaries increase; at least one.
std::int64_t distance_to_nearest(std::span<const std::int64_t> boundaries, std::int64_t height);

}  // namespace lamina::heights
