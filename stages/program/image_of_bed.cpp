#include "stages/program/image_of_bed.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "stages/data/units.h"

namespace lamina::program {

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
