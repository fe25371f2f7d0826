// tests/dose/rebuilt.h: the surface that a stack of drops stands for, and how far it lies from the true one.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/mesh.h"

namespace lamina::test {

using Position = std::array<double, 3>;  // mm

/// How a part becomes drops.
struct DropWay {
  std::int64_t dpi = 300;
  Nm thickness = 300'000;
  std::uint32_t levels = 0;  // of shares of voxels; 0: a pixel is set or not by its centre
  bool dithered = false;     // drops of one size by blue noise; else a full voxel has levels - 1 of them
};

/// Drops of each voxel over those of a full one, layer by layer from the bottom, row by row from the front.
class DropStack {
 public:
  DropStack(const std::vector<Triangle>& part, const DropWay& way, double bed_mm, double height_mm);

  /// Whether a point is solid if each voxel is filled from the side of its fullest neighbour: of those below, above, left,
  /// right, in front and behind the first of the fullest.
  bool filled(const Position& at) const;
  /// Saturation at a point over that of a solid, if drops are Gaussians of sigma a pixel in the plane and a third of a layer in
  /// height; solid where it is half or more.
  double blurred(const Position& at) const;

 private:
  float share(std::int64_t column, std::int64_t row, std::int64_t layer) const;
  std::array<double, 3> pitch_mm_{};
  std::array<std::int64_t, 3> count_{};
  std::vector<float> share_;
};

/// Points of a true surface with their outward normals.
struct SurfacePoint {
  Position at, normal;
};

/// From each point along its normal to the nearest change from solid to empty within 0.4 mm.
struct SurfaceDistance {
  double rms_mm = 0;
  std::uint32_t lost = 0;  // points without one
};
SurfaceDistance distance_of_filled(const DropStack& stack, const std::vector<SurfacePoint>& points);
SurfaceDistance distance_of_blurred(const DropStack& stack, const std::vector<SurfacePoint>& points);

/// A part, and points of the surface that is looked at: away from edges of the part.
struct RebuiltShape {
  const char* name;
  double bed_mm, height_mm;
  std::vector<Triangle> part;
  std::vector<SurfacePoint> points;
};
RebuiltShape rebuilt_sphere(std::uint32_t points);
RebuiltShape rebuilt_wedge(const char* name, double degrees, std::uint32_t points);

}  // namespace lamina::test
