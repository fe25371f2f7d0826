// stages/raster/segment.h: where one triangle of a mesh meets one layer plane, and the exact columns of its crossings.
//
// Everything that decides a pixel is a comparison of whole numbers. Doubles only guess; whenever a guess lies so close
// to a whole number that rounding could have moved it across, integers answer instead.
//
// Why no crossing is lost or counted twice:
//  - a corner with z <= Z is below the plane, so a triangle is cut through exactly two edges or not at all, even if
//    corners lie exactly in the plane; corners some nanometres above count as in it (height_for_plane() in mesh.h), in all
//    their triangles. So a plane meets just the triangles that one kPlaneReach higher would without this rule;
//  - the rows of a segment are the half-open range [row(end 1), row(end 2)), where row(end) is the first row at or
//    beyond the end; it depends on the mesh edge that carries the end and on nothing else, so the segments on both
//    sides of an edge share rows without gap or overlap;
//  - the column of a crossing is the first pixel whose centre is at or beyond the exact intersection of row and plane
//    of the triangle, so a crossing is left of a pixel for all engines or for none.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/level_face.h"
#include "stages/data/mesh.h"
#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina::raster {

/// A mesh in clusters of 16 neighbouring triangles, the shape that both engines read; copies share them.
struct ClusteredMesh {
  std::shared_ptr<const MeshBlocks> blocks;
  std::span<const Box> bounds;  // nm, of each cluster
  std::uint32_t first_cap;      // clusters from here on hold only triangles that repair added
  bool closed;                  // as Mesh::closed

  std::uint32_t cluster_count() const { return static_cast<std::uint32_t>(bounds.size()); }
};

/// Groups the triangles of meshes into clusters and takes them out of the meshes (block_maker.h).
/// cost: O(T), parallel; nothing where the loader has made blocks
std::vector<ClusteredMesh> make_clusters(std::span<Mesh> meshes, Isa isa = Isa::kAuto);

/// Geometry rows [first, first + count()) of the cut of one triangle, and how it stands.
struct SegmentRows {
  std::uint32_t first;
  std::uint32_t count_and_flags;

  static constexpr std::uint32_t kEnters = 1;   // a ray towards +x goes into the solid
  static constexpr std::uint32_t kExact = 2;    // too flat against the row for doubles
  static constexpr std::uint32_t kUpright = 4;  // x does not change with y
  static constexpr std::uint32_t kFlagBits = 3;

  std::uint32_t count() const { return count_and_flags >> kFlagBits; }
  std::uint32_t end() const { return first + count(); }
  bool is(std::uint32_t flag) const { return (count_and_flags & flag) != 0; }
};

/// The triangle that was cut.
struct SegmentOrigin {
  std::uint32_t facet;     // cluster * kClusterSize + lane, in its mesh
  std::uint32_t instance;  // in the scene
};

/// Cuts of triangles in the plane of a layer; crossings are expanded from them row by row. An array a property: what expands
/// crossings reads 24 bytes a segment, and where it came from only if integers have to decide.
///
/// In geometry row r the crossing is near column[i] + columns_per_nm[i] * row_centre[r], which is the first column at or
/// beyond it, + 1 + PixelSampling::near_x, in pixels.
struct Segments {
  Buffer<double> column, columns_per_nm;
  Buffer<SegmentRows> rows;
  Buffer<SegmentOrigin> origin;
  std::size_t size = 0;  // the arrays may be longer
  Buffer<LevelFace> level;  // of each instance that has any in this layer

  static constexpr std::size_t kBytes = 2 * sizeof(double) + sizeof(SegmentRows) + sizeof(SegmentOrigin);  // a segment

  /// Makes all arrays so long that `more` segments can be written behind those that are there, and an eighth more where they
  /// have to grow.
  void ensure_capacity(std::size_t more);
  /// Appends one of another list's.
  void append(const Segments& other, std::size_t i);
  std::uint64_t bytes() const {
    return bytes_held(column) + bytes_held(columns_per_nm) + bytes_held(rows) + bytes_held(origin) +
           bytes_held(level);
  }
};

/// A mesh on the bed, as far as exact columns need it.
struct PlacedMesh {
  const ClusteredMesh* mesh;
  Point3 offset;  // nm
};

/// The pixel grid as the kernels use it.
struct PixelSampling {
  PixelAxis x, y;
  double columns_per_nm, rows_per_nm;
  double near_x, near_y;  // pixels; a guess closer than this to a whole number is decided in integers
  Buffer<Nm> row_centre;  // nm, of each geometry row, kMoreCentres more at the end

  static constexpr std::uint32_t kMoreCentres = 8;

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

/// The triangle that was cut, on the bed, with its corners' heights as they count for the plane.
ExactTriangle exact_triangle(const SegmentOrigin& origin, std::span<const PlacedMesh> placed, Nm plane);

/// The first column whose centre is at or beyond the crossing of the triangle's plane with row centre y at height z.
/// Needs nx != 0. Integers only: the crossing is a.x - (ny (y - a.y) + nz (z - a.z)) / nx, and a whole-numbered
/// centre is at or beyond it exactly if it is at or beyond its ceiling.
std::int64_t exact_column(const PixelAxis& axis, const ExactTriangle& triangle, Nm y, Nm z);

/// The first row whose centre is at or beyond the point in which the edge from -> to meets height z. The edge must
/// cross z: exactly one of its ends has z' <= z.
std::int64_t exact_row(const PixelAxis& axis, const Point3& from, const Point3& to, Nm z);

}  // namespace lamina::raster
