// stages/raster/segment.h: where one triangle meets one layer plane, and the exact columns of its crossings.
//
// Everything that decides a pixel is a comparison of whole numbers. Doubles only guess; whenever a guess lies so close
// to a whole number that rounding could have moved it across, integers answer instead.
//
// Why no crossing is lost or counted twice:
//  - a corner with z <= Z is below the plane, so a triangle is cut through exactly two edges or not at all, whatever
//    lies exactly in the plane;
//  - the rows of a segment are the half-open range [row(end 1), row(end 2)), where row(end) is the first row at or
//    beyond the end; it depends on the mesh edge that carries the end and on nothing else, so the segments on both
//    sides of an edge share rows without gap or overlap;
//  - the column of a crossing is the first pixel whose centre is at or beyond the exact intersection of row and plane
//    of the triangle, so a crossing is left of a pixel for all engines or for none.
#pragma once

#include <cmath>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/raster/clusters.h"

namespace lamina::raster {

/// The cut of one triangle, as wide as its rows. 40 bytes; crossings are expanded from it row by row.
struct Segment {
  double column;            // of the crossing in row `first_row`, + 1 + PixelSampling::near, in pixels
  double columns_per_nm;    // slope over y
  std::uint32_t first_row;  // geometry rows [first_row, last_row)
  std::uint32_t last_row;
  std::uint32_t cluster;   // in its mesh
  std::uint32_t instance;  // in the scene
  std::uint32_t flags;     // lane in the low 4 bits, then kEnters, kExact, kUpright, kCap

  static constexpr std::uint32_t kLane = 15;
  static constexpr std::uint32_t kEnters = 16;   // a ray towards +x goes into the solid
  static constexpr std::uint32_t kExact = 32;    // too flat against the row for doubles
  static constexpr std::uint32_t kUpright = 64;  // x does not change with y
  static constexpr std::uint32_t kCap = 128;     // of a triangle that repair added
};

using Segments = Buffer<Segment>;

/// The pixel grid as the kernels use it.
struct PixelSampling {
  PixelAxis x, y;
  double columns_per_nm, rows_per_nm;
  double near_x, near_y;  // pixels; a guess closer than this to a whole number is decided in integers
  Buffer<Nm> row_centre;  // nm, of each geometry row, one more at the end

  explicit PixelSampling(const PixelGrid& grid);
};

/// Three corners in the order of the facet, and the doubled area normal (exact: corners differ by less than 2^31).
struct ExactTriangle {
  Point3 a, b, c;
  std::int64_t nx, ny, nz;
  ExactTriangle(const Point3& first, const Point3& second, const Point3& third) : a(first), b(second), c(third) {
    const std::int64_t ux = std::int64_t{b.x} - a.x, uy = std::int64_t{b.y} - a.y, uz = std::int64_t{b.z} - a.z;
    const std::int64_t vx = std::int64_t{c.x} - a.x, vy = std::int64_t{c.y} - a.y, vz = std::int64_t{c.z} - a.z;
    nx = uy * vz - uz * vy;
    ny = uz * vx - ux * vz;
    nz = ux * vy - uy * vx;
  }
};

/// A corner on the bed.
inline Point3 on_bed(const Point3& corner, const Point3& offset) {
  return {corner.x + offset.x, corner.y + offset.y, corner.z + offset.z};
}
inline Point3 corner_on_bed(const Cluster& cluster, std::uint32_t corner, std::uint32_t lane, const Point3& offset) {
  return {cluster.x[corner][lane] + offset.x, cluster.y[corner][lane] + offset.y, cluster.z[corner][lane] + offset.z};
}

/// The first column whose centre is at or beyond the crossing of the triangle's plane with row centre y at height z.
/// Needs nx != 0. Integers only: the crossing is a.x - (ny (y - a.y) + nz (z - a.z)) / nx, and a whole-numbered
/// centre is at or beyond it exactly if it is at or beyond its ceiling.
std::int64_t exact_column(const PixelAxis& axis, const ExactTriangle& triangle, Nm y, Nm z);

/// The first row whose centre is at or beyond the point in which the edge from -> to meets height z. The edge must
/// cross z: exactly one of its ends has z' <= z.
std::int64_t exact_row(const PixelAxis& axis, const Point3& from, const Point3& to, Nm z);

/// A cluster as it stands on the bed.
struct SegmentSource {
  const Cluster* cluster;
  std::uint32_t cluster_index;
  std::uint32_t instance;
  Point3 offset;  // of the instance
  bool cap;
};

/// Appends the segments of the cluster's triangles that the plane cuts, restricted to geometry rows
/// [row_begin, row_end); a triangle cut in none of these rows leaves none.
void append_segments(const PixelSampling& sampling, const SegmentSource& source, Nm plane, std::uint32_t row_begin,
                     std::uint32_t row_end, Segments& out);

}  // namespace lamina::raster
