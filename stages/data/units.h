// stages/data/units.h: lengths are integer nanometres everywhere after a file is read.
#pragma once

#include <cmath>
#include <cstdint>

namespace lamina {

/// A coordinate, height or distance in nanometres. The reach is +-2.147 m; a vertex beyond it is an input error.
using Nm = std::int32_t;

inline constexpr std::int64_t kNmPerMm = 1'000'000;
inline constexpr std::int64_t kNmPerInch = 25'400'000;
inline constexpr std::int64_t kNmReach = 2'147'483'647;

/// Up to so many nm above a sampling plane, a vertex counts as in it (mesh.h): a float in mm has steps of 31 nm from 256 mm on.
inline constexpr Nm kPlaneReach = 100;

/// An angle in millionths of a degree; 0 is +x, anticlockwise. Directions on the bed are whole ones.
using MicroDegrees = std::int64_t;
inline constexpr MicroDegrees kTurn = 360'000'000;

/// Millimetres of a length in nanometres; for reports, never for decisions.
constexpr double mm(std::int64_t nm) { return static_cast<double>(nm) / kNmPerMm; }

/// To the nearest whole number, halves away from zero: llround() without the call. |value| < 2^63
inline std::int64_t nearest(double value) {
  // Truncation is exact, the rest is exact, and so is its comparison with a half.
  const auto whole = static_cast<std::int64_t>(value);
  const double rest = value - static_cast<double>(whole);
  return whole + (rest >= 0.5 ? 1 : 0) - (rest <= -0.5 ? 1 : 0);
}

/// Nanometres of a length in millimetres, to the nearest.
inline std::int64_t nm_of(double millimetres) { return std::llround(millimetres * static_cast<double>(kNmPerMm)); }

/// Quotient rounded towards minus infinity. `divisor` > 0.
template <class Integer>
constexpr Integer floor_div(Integer dividend, Integer divisor) {
  const Integer quotient = dividend / divisor;
  return quotient - (dividend % divisor < 0 ? 1 : 0);
}

/// Quotient rounded towards plus infinity. `divisor` > 0.
template <class Integer>
constexpr Integer ceil_div(Integer dividend, Integer divisor) {
  const Integer quotient = dividend / divisor;
  return quotient + (dividend % divisor > 0 ? 1 : 0);
}

}  // namespace lamina
