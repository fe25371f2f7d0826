#include "stages/program/reach.h"

#include <cmath>

#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina::program {

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

std::optional<Outside> first_outside(const Machine& machine, const PixelGrid& grid, const RunsView& image) {
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

}  // namespace lamina::program
