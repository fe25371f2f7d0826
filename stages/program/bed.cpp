#include "stages/program/bed.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "stages/data/units.h"
#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina::program {
namespace {

using Corner = std::array<float, 3>;

/// The twelve triangles of a box, counter-clockwise from outside.
void add_box(const Corner& lo, const Corner& hi, std::vector<std::array<Corner, 3>>& triangles) {
  const auto corner = [&](int x, int y, int z) -> Corner { return {x ? hi[0] : lo[0], y ? hi[1] : lo[1], z ? hi[2] : lo[2]}; };
  const auto face = [&](const Corner& a, const Corner& b, const Corner& c, const Corner& d) {
    triangles.push_back({a, b, c});
    triangles.push_back({a, c, d});
  };
  face(corner(0, 0, 0), corner(0, 1, 0), corner(1, 1, 0), corner(1, 0, 0));
  face(corner(0, 0, 1), corner(1, 0, 1), corner(1, 1, 1), corner(0, 1, 1));
  face(corner(0, 0, 0), corner(1, 0, 0), corner(1, 0, 1), corner(0, 0, 1));
  face(corner(0, 1, 0), corner(0, 1, 1), corner(1, 1, 1), corner(1, 1, 0));
  face(corner(0, 0, 0), corner(0, 0, 1), corner(0, 1, 1), corner(0, 1, 0));
  face(corner(1, 0, 0), corner(1, 1, 0), corner(1, 1, 1), corner(1, 0, 1));
}

}  // namespace

std::optional<Outside> first_outside(const Machine& machine, const Mesh& mesh, const Point3& offset) {
  const std::int64_t top = nm_of(machine.bed.build_height_mm);
  const std::int64_t width = nm_of(machine.bed.size_mm[0]);
  const std::int64_t depth = nm_of(machine.bed.size_mm[1]);
  std::optional<Outside> worst;
  __int128 farthest = 0;
  const auto inspection = [&](const Point3& vertex) {
    const std::int64_t x = std::int64_t{vertex.x} + offset.x, y = std::int64_t{vertex.y} + offset.y;
    const std::int64_t z = std::int64_t{vertex.z} + offset.z;
    const Point3 position{static_cast<Nm>(x), static_cast<Nm>(y), static_cast<Nm>(z)};
    if (z > top && (!worst || !worst->above || position.z > worst->position.z)) worst = Outside{position, true, mm(z - top)};
    if (worst && worst->above) return;
    if (machine.bed.shape == BedShape::kRound) {
      const __int128 dx = 2 * x - width, dy = 2 * y - width;
      const __int128 beyond = dx * dx + dy * dy - __int128{width} * width;
      if (beyond <= farthest) return;
      farthest = beyond;
      const double radius = std::hypot(static_cast<double>(dx), static_cast<double>(dy)) / 2;
      worst = Outside{position, false, (radius - static_cast<double>(width) / 2) / kNmPerMm};
    } else {
      const std::int64_t beyond = std::max(std::max(-x, x - width), std::max(-y, y - depth));
      if (beyond <= farthest) return;
      farthest = beyond;
      worst = Outside{position, false, mm(beyond)};
    }
  };
  each_vertex(mesh, inspection);
  return worst;
}

std::optional<Outside> first_outside(const Machine& machine, const PixelGrid& grid, RowRuns image) {
  if (machine.bed.shape != BedShape::kRound) return {};
  const std::int64_t width = nm_of(machine.bed.size_mm[0]);
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto row = image.row(r);
    if (row.empty()) continue;
    const std::int64_t y = grid.y.centre(std::int64_t{grid.rows()} - 1 - r);
    for (const std::uint32_t column : {row.front(), row.back() - 1}) {
      const std::int64_t x = grid.x.centre(column);
      const __int128 dx = 2 * x - width, dy = 2 * y - width;
      if (dx * dx + dy * dy <= __int128{width} * width) continue;
      const double radius = std::hypot(static_cast<double>(dx), static_cast<double>(dy)) / 2;
      return Outside{{static_cast<Nm>(x), static_cast<Nm>(y), 0}, false, (radius - static_cast<double>(width) / 2) / kNmPerMm};
    }
  }
  return {};
}

Buffer<std::byte> orientation_target() {
  std::vector<std::array<Corner, 3>> triangles;
  add_box({0, 0, 0}, {6, 30, 2}, triangles);    // stem
  add_box({5, 24, 0}, {20, 30, 2}, triangles);  // upper arm; boxes overlap and are merged
  add_box({5, 12, 0}, {14, 18, 2}, triangles);  // lower arm
  add_box({0, 0, 1}, {6, 6, 3}, triangles);     // the step
  Buffer<std::byte> file(84 + triangles.size() * 50);
  std::memset(file.data(), 0, file.size());
  std::memcpy(file.data(), "orientation target", 18);
  const auto count = static_cast<std::uint32_t>(triangles.size());
  std::memcpy(file.data() + 80, &count, 4);
  for (std::size_t i = 0; i < triangles.size(); ++i) std::memcpy(file.data() + 84 + 50 * i + 12, triangles[i].data(), 36);
  return file;
}

Runs image_of_bed(const Machine& machine, const PixelGrid& grid) {
  const bool round = machine.bed.shape == BedShape::kRound;
  const double width = machine.bed.size_mm[0] * kNmPerMm, radius = width / 2;
  // The first pixel whose centre does not lie before a place.
  const auto pixel = [](const PixelAxis& axis, double nm) {
    return static_cast<std::uint32_t>(std::clamp(std::ceil(nm * axis.pixels_per_nm() - 0.5), 0.0, double(axis.count)));
  };
  const std::uint32_t rows = grid.rows(), behind = rows - pixel(grid.y, machine.bed.size_mm[1] * kNmPerMm);
  Runs runs;
  runs.columns = grid.columns();
  runs.row_offset.push_back(0);
  for (std::uint32_t r = 0; r < rows; ++r) {
    const double y = static_cast<double>(grid.y.centre(rows - 1 - r)) - radius;
    const double half = round ? std::sqrt(std::max(0.0, radius * radius - y * y)) : radius;
    const std::uint32_t begin = pixel(grid.x, radius - half), end = pixel(grid.x, radius + half);
    if (r >= behind && begin < end) runs.change.insert(runs.change.end(), {begin, end});
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

}  // namespace lamina::program
