// stages/load/transform.h: transforms of a file's coordinates, and how these become integer nanometres; internal to load.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "stages/data/mesh.h"
#include "stages/load/load.h"

namespace lamina::load {

using Vector = std::array<double, 3>;
using Matrix = std::array<double, 9>;  // row-major

inline Vector minus(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

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
inline Vector multiply(const Matrix& linear, const Vector& vector) {
  return {linear[0] * vector[0] + linear[1] * vector[1] + linear[2] * vector[2],
          linear[3] * vector[0] + linear[4] * vector[1] + linear[5] * vector[2],
          linear[6] * vector[0] + linear[7] * vector[1] + linear[8] * vector[2]};
}

/// The transform that does `inner` first and `outer` afterwards.
inline Transform after(const Transform& outer, const Transform& inner) {
  Transform both;
  both.linear = multiply(outer.linear, inner.linear);
  both.translation = multiply(outer.linear, inner.translation);
  for (std::size_t axis = 0; axis < 3; ++axis) both.translation[axis] += outer.translation[axis];
  return both;
}

enum class Snapped { kYes, kNotFinite, kBeyondReach };

/// The file's unit and the job's transform as one function from a file's numbers to a vertex in nm.
class Snapper {
 public:
  Snapper(const Transform& transform, double unit_mm)
      : transform_(transform), unit_mm_(unit_mm), mirrors_(transform.mirrors()) {
    const Transform identity;
    plain_ = unit_mm == 1.0 && transform.linear == identity.linear && transform.translation == identity.translation;
  }

  /// The numbers are mm and stay where they are: snapping is llround(1e6 * x) alone.
  bool plain() const { return plain_; }
  /// Facets must be turned over.
  bool mirrors() const { return mirrors_; }

  Snapped snap(double x, double y, double z, Point3& out) const {
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z)) return Snapped::kNotFinite;
    if (plain_) return round(x, y, z, out);
    const Vector at = multiply(transform_.linear, Vector{x * unit_mm_, y * unit_mm_, z * unit_mm_});
    return round(at[0] + transform_.translation[0], at[1] + transform_.translation[1], at[2] + transform_.translation[2], out);
  }

 private:
  static bool round(double mm, Nm& out) {
    const double nm = mm * 1e6;
    if (!(std::fabs(nm) < 2147483647.5)) return false;
    out = static_cast<Nm>(nearest(nm));
    return true;
  }
  static Snapped round(double x, double y, double z, Point3& out) {
    return round(x, out.x) && round(y, out.y) && round(z, out.z) ? Snapped::kYes : Snapped::kBeyondReach;
  }

  Transform transform_;
  double unit_mm_;
  bool mirrors_;
  bool plain_;
};

/// Words for an error message.
inline const char* what_is_wrong(Snapped snapped) {
  return snapped == Snapped::kNotFinite
             ? "a coordinate is not finite; export the part again, or drop such facets with --drop-bad"
             : "a coordinate is beyond the reach of +-2147 mm; move the part to the origin, or check its unit and "
               "scale";
}

}  // namespace lamina::load
