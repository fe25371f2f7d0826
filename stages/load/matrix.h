// stages/load/matrix.h: products of the 3 x 3 matrices in transforms; internal to load.
#pragma once

#include <array>
#include <cstddef>

#include "stages/load/load.h"

namespace lamina::load {

using Matrix = std::array<double, 9>;  // row-major

/// first * second: what a point meets first is `second`.
inline Matrix multiply(const Matrix& first, const Matrix& second) {
  Matrix product{};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column)
      product[3 * row + column] =
          first[3 * row] * second[column] + first[3 * row + 1] * second[3 + column] + first[3 * row + 2] * second[6 + column];
  return product;
}

/// linear * vector.
inline std::array<double, 3> apply(const Matrix& linear, const std::array<double, 3>& vector) {
  return {linear[0] * vector[0] + linear[1] * vector[1] + linear[2] * vector[2],
          linear[3] * vector[0] + linear[4] * vector[1] + linear[5] * vector[2],
          linear[6] * vector[0] + linear[7] * vector[1] + linear[8] * vector[2]};
}

/// The transform that does `inner` first and `outer` afterwards.
inline Transform after(const Transform& outer, const Transform& inner) {
  Transform both;
  both.linear = multiply(outer.linear, inner.linear);
  both.translation = apply(outer.linear, inner.translation);
  for (std::size_t axis = 0; axis < 3; ++axis) both.translation[axis] += outer.translation[axis];
  return both;
}

}  // namespace lamina::load
