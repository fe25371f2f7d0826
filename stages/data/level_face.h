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
  std::uint64_t area_um2 = 0;  // projected on the plane
  Nm plane = 0;                // nm above the bed
  std::uint32_t owner = 0;     // an instance of the scene, or a body

  /// double_area  of a triangle, projected, nm2
  void add(std::uint64_t double_area) { area_um2 += double_area / 2'000'000; }
  /// Heights of a triangle's corners above the plane, nm.
  static bool is_level(std::int64_t a, std::int64_t b, std::int64_t c) {
    return std::max({a, b, c}) <= kLevelReach && std::min({a, b, c}) >= -kLevelReach;
  }
  /// Keeps the larger of two; the first where they are equal.
  void keep_larger(const LevelFace& other) {
    if (other.area_um2 > area_um2) *this = other;
  }
};

}  // namespace lamina
