// stages/load/transform.cpp: the job's scale, rotation and shrink factors as one matrix.
#include <cmath>

#include "stages/load/load.h"
#include "stages/load/matrix.h"

namespace lamina::load {
namespace {

/// Sine and cosine; quarter turns are exact, so that a part turned by 90 degrees keeps every bit.
void sine_cosine(double degrees, double& sine, double& cosine) {
  const double turn = std::remainder(degrees, 360.0);  // exact
  if (turn == 0) {
    sine = 0, cosine = 1;
  } else if (turn == 90) {
    sine = 1, cosine = 0;
  } else if (turn == -90) {
    sine = -1, cosine = 0;
  } else if (turn == 180 || turn == -180) {
    sine = 0, cosine = -1;
  } else {
    const double radians = turn * 3.14159265358979323846 / 180.0;
    sine = std::sin(radians), cosine = std::cos(radians);
  }
}

}  // namespace

bool Transform::mirrors() const {
  const auto& m = linear;
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]) < 0;
}

Transform make_transform(const std::array<double, 3>& scale, const std::array<double, 3>& rotate_deg,
                         const std::array<double, 3>& shrink) {
  std::array<double, 3> s{}, c{};
  for (std::size_t axis = 0; axis < 3; ++axis) sine_cosine(rotate_deg[axis], s[axis], c[axis]);
  const Matrix about_x{1, 0, 0, 0, c[0], -s[0], 0, s[0], c[0]};
  const Matrix about_y{c[1], 0, s[1], 0, 1, 0, -s[1], 0, c[1]};
  const Matrix about_z{c[2], -s[2], 0, s[2], c[2], 0, 0, 0, 1};
  const Matrix scaled{scale[0], 0, 0, 0, scale[1], 0, 0, 0, scale[2]};
  const Matrix shrunk{shrink[0], 0, 0, 0, shrink[1], 0, 0, 0, shrink[2]};
  Transform transform;
  transform.linear = multiply(shrunk, multiply(about_z, multiply(about_y, multiply(about_x, scaled))));
  return transform;
}

}  // namespace lamina::load
