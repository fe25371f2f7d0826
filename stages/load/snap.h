// stages/load/snap.h: coordinates of a file become integer nanometres; internal to load.
#pragma once

#include <cmath>
#include <cstdint>

#include "stages/data/mesh.h"
#include "stages/load/load.h"
#include "stages/load/matrix.h"

namespace lamina::load {

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
    const std::array<double, 3> at = apply(transform_.linear, {x * unit_mm_, y * unit_mm_, z * unit_mm_});
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
