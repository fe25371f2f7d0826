#include "tests/coverage/oracle.h"

#include <algorithm>
#include <array>

namespace lamina::test {
namespace {

using Vertex = std::array<mpq_class, 3>;
using Shape = std::vector<Vertex>;

struct VoxelBox {
  std::array<std::int64_t, 3> lo, hi;
};

mpq_class number(std::int64_t value) { return mpq_class(static_cast<long>(value)); }

/// What lies where side * coordinate >= side * limit.
Shape cut_off(Shape shape, int axis, std::int64_t at, int side) {
  const mpq_class limit = number(at);
  if (std::ranges::all_of(shape, [&](const Vertex& a) { return side * cmp(a[axis], limit) >= 0; })) return shape;
  Shape result;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    const Vertex &a = shape[i], &b = shape[(i + 1) % shape.size()];
    const int from = side * cmp(a[axis], limit), to = side * cmp(b[axis], limit);
    if (from >= 0) result.push_back(a);
    if (from * to >= 0) continue;
    const mpq_class share = (limit - a[axis]) / (b[axis] - a[axis]);
    Vertex on;
    for (int k = 0; k < 3; ++k) on[k] = a[k] + share * (b[k] - a[k]);
    result.push_back(on);
  }
  return result;
}

/// Area seen from above, doubled, counter-clockwise; and the same times the mean of z.
void measure(const Shape& shape, mpq_class& area, mpq_class& moment) {
  area = moment = 0;
  for (std::size_t k = 1; k + 1 < shape.size(); ++k) {
    const Vertex &a = shape[0], &b = shape[k], &c = shape[k + 1];
    const mpq_class part = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    area += part;
    moment += part * (a[2] + b[2] + c[2]) / 3;
  }
}

mpq_class volume_above(const Triangle& t, const VoxelBox& box) {
  Shape shape;
  for (const Point3* p : {&t.a, &t.b, &t.c}) shape.push_back({number(p->x), number(p->y), number(p->z)});
  for (int axis = 0; axis < 2; ++axis) {
    shape = cut_off(cut_off(std::move(shape), axis, box.lo[axis], 1), axis, box.hi[axis], -1);
  }
  if (shape.empty()) return 0;
  const Shape below = cut_off(shape, 2, box.lo[2], -1);
  Shape within;
  if (std::max({t.a.z, t.b.z, t.c.z}) > box.lo[2]) {  // a level facet there lies below
    within = cut_off(cut_off(std::move(shape), 2, box.lo[2], 1), 2, box.hi[2], -1);
  }
  mpq_class area, moment, result;
  measure(below, area, moment);
  result = area * number(box.hi[2] - box.lo[2]);
  measure(within, area, moment);
  result += area * number(box.hi[2]) - moment;
  return -result / 2;  // above a facet that looks up nothing is solid
}

using Wide = __int128;

/// A facet that a line along x crosses, as a sample on that line sees it; sixteenths of a nanometre.
struct CrossedFacet {
  std::int64_t nx, x;  // of its normal and of a corner
  Wide rest;           // what y and z of the line add to the side of its plane
};
using SampleLine = std::vector<CrossedFacet>;

/// Facets that count along the line, by the rules of the bitmap contract.
SampleLine line_at(std::span<const Triangle> facets, std::int64_t y, std::int64_t z) {
  SampleLine line;
  for (const Triangle& t : facets) {
    const std::array<const Point3*, 3> p{&t.a, &t.b, &t.c};
    int before = 0, cut = 0;
    for (int i = 0; i < 3; ++i) {
      const Point3 *low = p[i], *high = p[(i + 1) % 3];
      if ((16 * std::int64_t{low->z} <= z) == (16 * std::int64_t{high->z} <= z)) continue;
      if (low->z > high->z) std::swap(low, high);
      ++cut;
      const Wide run = static_cast<Wide>(16) * (std::int64_t{high->y} - low->y) * (z - 16 * std::int64_t{low->z});
      const Wide rise = static_cast<Wide>(16) * (std::int64_t{high->z} - low->z) * (y - 16 * std::int64_t{low->y});
      if (run <= rise) ++before;
    }
    if (cut == 0 || before != 1) continue;
    const std::int64_t ux = t.b.x - t.a.x, uy = t.b.y - t.a.y, uz = t.b.z - t.a.z;
    const std::int64_t vx = t.c.x - t.a.x, vy = t.c.y - t.a.y, vz = t.c.z - t.a.z;
    const std::int64_t nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    line.push_back(
        {nx, 16 * std::int64_t{t.a.x},
         static_cast<Wide>(ny) * (y - 16 * std::int64_t{t.a.y}) + static_cast<Wide>(nz) * (z - 16 * std::int64_t{t.a.z})});
  }
  return line;
}

int winding_at(const SampleLine& line, std::int64_t x) {
  int winding = 0;
  for (const CrossedFacet& facet : line) {
    const Wide side = static_cast<Wide>(facet.nx) * (x - facet.x) + facet.rest;
    if (facet.nx < 0 && side <= 0) ++winding;
    if (facet.nx > 0 && side >= 0) --winding;
  }
  return winding;
}

/// Sixteenths of a nanometre.
std::int64_t sample_at(const VoxelBox& box, int axis, std::int64_t i) {
  return 16 * box.lo[axis] + (2 * i + 1) * (box.hi[axis] - box.lo[axis]);
}

VoxelFacts facts_of(std::span<const Triangle> of_column, std::span<const SampleLine> lines, const VoxelBox& box) {
  VoxelFacts facts;
  for (const SampleLine& line : lines) {
    for (std::int64_t s = 0; s < 8; ++s) ++facts.samples[winding_at(line, sample_at(box, 0, s))];
  }
  if (facts.samples.begin()->first < 0 || facts.samples.rbegin()->first > 1) return facts;
  for (const Triangle& t : of_column) facts.share += volume_above(t, box);
  for (int axis = 0; axis < 3; ++axis) facts.share /= number(box.hi[axis] - box.lo[axis]);
  return facts;
}

}  // namespace

std::vector<VoxelFacts> oracle_voxels(std::span<const Triangle> facets, const PixelGrid& grid, const Layer& layer,
                                      const VoxelWindow& window) {
  const auto end_of = [](const PixelAxis& axis, std::uint32_t i) { return std::int64_t{i} * axis.span / axis.dots; };
  std::vector<VoxelFacts> result;
  std::vector<Triangle> of_row, in_layer, of_column;
  std::vector<SampleLine> lines;
  for (std::uint32_t j = window.first; j < window.last; ++j) {
    VoxelBox box;
    box.lo[1] = end_of(grid.y, j), box.hi[1] = end_of(grid.y, j + 1);
    box.lo[2] = layer.bottom, box.hi[2] = std::int64_t{layer.bottom} + layer.thickness;
    of_row.clear(), in_layer.clear(), lines.clear();
    for (const Triangle& t : facets) {
      if (std::max({t.a.y, t.b.y, t.c.y}) < box.lo[1] || std::min({t.a.y, t.b.y, t.c.y}) > box.hi[1]) continue;
      if (std::min({t.a.z, t.b.z, t.c.z}) > box.hi[2]) continue;
      of_row.push_back(t);
      if (std::max({t.a.z, t.b.z, t.c.z}) >= box.lo[2]) in_layer.push_back(t);
    }
    for (std::int64_t l = 0; l < 8; ++l) {
      for (std::int64_t k = 0; k < 8; ++k) lines.push_back(line_at(in_layer, sample_at(box, 1, k), sample_at(box, 2, l)));
    }
    for (std::uint32_t i = window.left; i < window.right; ++i) {
      box.lo[0] = end_of(grid.x, i), box.hi[0] = end_of(grid.x, i + 1);
      of_column.clear();
      for (const Triangle& t : of_row) {
        if (std::min({t.a.x, t.b.x, t.c.x}) > box.hi[0]) continue;
        if (std::max({t.a.x, t.b.x, t.c.x}) >= box.lo[0]) of_column.push_back(t);
      }
      result.push_back(facts_of(of_column, lines, box));
    }
  }
  return result;
}

std::uint8_t oracle_level(const VoxelFacts& voxel, FillRule rule, std::uint32_t levels) {
  const long n = static_cast<long>(levels) - 1;
  int solid = 0;
  for (const auto& [winding, count] : voxel.samples) solid += is_solid(rule, winding) ? count : 0;
  const bool exact = voxel.samples.begin()->first >= 0 && voxel.samples.rbegin()->first <= 1;
  mpq_class share(solid, 512);
  share.canonicalize();
  const mpq_class position = (exact ? voxel.share : share) * n + mpq_class(1, 2);
  mpz_class level;
  mpz_fdiv_q(level.get_mpz_t(), position.get_num_mpz_t(), position.get_den_mpz_t());
  return static_cast<std::uint8_t>(std::clamp<long>(level.get_si(), 0, n));
}

}  // namespace lamina::test
