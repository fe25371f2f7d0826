#include "stages/raster/segment.h"

#include <algorithm>

#include "stages/geometry/blocks/block_maker.h"

namespace lamina::raster {
namespace {

using Int128 = __int128;

/// Nanometres by which a guess may miss a whole-numbered centre: 1 for the rounding down of centres, the rest spare.
constexpr double kNearNm = 1.5;

}  // namespace

std::vector<ClusteredMesh> make_clusters(std::span<Mesh> meshes, Isa isa) {
  const std::vector<std::shared_ptr<MeshBlocks>> blocks = take_blocks(meshes, isa);
  std::vector<ClusteredMesh> clustered;
  clustered.reserve(meshes.size());
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    clustered.push_back({blocks[i], blocks[i]->bounds(), blocks[i]->first_cap(), meshes[i].closed});
  }
  return clustered;
}

PixelSampling::PixelSampling(const PixelGrid& grid)
    : x(grid.x),
      y(grid.y),
      columns_per_nm(grid.x.pixels_per_nm()),
      rows_per_nm(grid.y.pixels_per_nm()),
      near_x(kNearNm * columns_per_nm),
      near_y(kNearNm * rows_per_nm),
      row_centre(std::size_t{grid.rows()} + kMoreCentres) {
  for (std::uint32_t row = 0; row < row_centre.size(); ++row) {
    row_centre[row] = static_cast<Nm>(std::min(y.centre(row), kNmReach));
  }
}

void Segments::ensure_capacity(std::size_t more) {
  if (column.size() - size >= more) return;
  const std::size_t capacity = size + more + (size + more) / 8;
  const auto lengthen = [&](auto& array) {
    if (size == 0) array.clear();  // nothing is worth moving
    array.reserve(capacity);       // resize() alone would double, beyond what layers are said to need
    array.resize(capacity);
  };
  lengthen(origin), lengthen(rows), lengthen(columns_per_nm);
  lengthen(column);  // last: its length stands for all
}

void Segments::append(const Segments& other, std::size_t i) {
  ensure_capacity(1);
  column[size] = other.column[i];
  columns_per_nm[size] = other.columns_per_nm[i];
  rows[size] = other.rows[i];
  origin[size] = other.origin[i];
  ++size;
}

ExactTriangle exact_triangle(const SegmentOrigin& origin, std::span<const PlacedMesh> placed, Nm plane) {
  const PlacedMesh& part = placed[origin.instance];
  const Triangle facet = part.mesh->blocks->triangle(origin.facet / kClusterSize, origin.facet % kClusterSize);
  const auto on_bed = [&](const Point3& p) { 
    return Point3{p.x + part.offset.x, p.y + part.offset.y, height_for_plane(p.z + part.offset.z, plane)};
  };
  return {on_bed(facet.a), on_bed(facet.b), on_bed(facet.c)};
}

std::int64_t exact_column(const PixelAxis& axis, const ExactTriangle& triangle, Nm y, Nm z) {
  Int128 numerator =
      Int128{triangle.ny} * (std::int64_t{y} - triangle.a.y) + Int128{triangle.nz} * (std::int64_t{z} - triangle.a.z);
  Int128 denominator = triangle.nx;
  if (denominator < 0) {
    numerator = -numerator;
    denominator = -denominator;
  }
  const auto x = static_cast<std::int64_t>(triangle.a.x + ceil_div(-numerator, denominator));
  return axis.first_at_or_beyond(x);
}

std::int64_t exact_row(const PixelAxis& axis, const Point3& from, const Point3& to, Nm z) {
  std::int64_t numerator = (std::int64_t{to.y} - from.y) * (std::int64_t{z} - from.z);
  std::int64_t denominator = std::int64_t{to.z} - from.z;
  if (denominator < 0) {
    numerator = -numerator;
    denominator = -denominator;
  }
  return axis.first_at_or_beyond(from.y + ceil_div(numerator, denominator));
}

}  // namespace lamina::raster
