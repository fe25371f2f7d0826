// stages/data/level_face.h: horizontal faces that lie so close to a sampling plane that noise decides which of their triangles it
// cuts.
#pragma once

#include <algorithm>
#include <cstdint>

#include "stages/data/units.h"

namespace lamina {

/// How far, nm, corners of a horizontal face may lie from a plane to be reported: what files of 6 digits and rotations make of it.
inline constexpr Nm kLevelReach = 1000;

/// What one owner has of such triangles in a layer: all corners within kLevelReach of the plane, which cuts them all the same.
struct LevelFace {
  std::uint64_t area_um2 = 0;    // projected on the plane
  Nm lowest = 0, highest = 0;    // of their corners, above the plane
  std::uint32_t owner = 0;       // an instance of the scene, or a body

  /// Heights of a triangle's corners above the plane. double_area  projected, nm2
  void add(Nm a, Nm b, Nm c, std::uint64_t double_area) {
    const auto [low, high] = std::minmax({a, b, c});
    lowest = area_um2 == 0 ? low : std::min(lowest, low);
    highest = area_um2 == 0 ? high : std::max(highest, high);
    area_um2 += double_area / 2'000'000;
  }
  static bool is_level(std::int64_t a, std::int64_t b, std::int64_t c) {
    return std::max({a, b, c}) <= kLevelReach && std::min({a, b, c}) >= -kLevelReach;
  }
  /// Keeps the larger of two; the first where they are equal.
  void keep_larger(const LevelFace& other) {
    if (other.area_um2 > area_um2) *this = other;
  }
};

}  // namespace lamina
