#include "stages/dose/edges/erode.h"

#include <algorithm>
#include <cmath>

namespace lamina::dose {
namespace {

using Row = std::span<const std::uint32_t>;

/// Keeps of `kept` what lies at least `width` inside of the runs of `row`. `kept` and `result` are pairs of changes.
void keep_inside(const Buffer<std::uint32_t>& kept, Row row, std::uint32_t width, Buffer<std::uint32_t>& result) {
  result.clear();
  std::size_t k = 0;
  for (std::size_t i = 0; i + 1 < row.size() && k + 1 < kept.size(); i += 2) {
    if (row[i + 1] - row[i] <= 2 * width) continue;
    const std::uint32_t begin = row[i] + width, end = row[i + 1] - width;
    while (k + 1 < kept.size() && kept[k + 1] <= begin) k += 2;
    for (std::size_t j = k; j + 1 < kept.size() && kept[j] < end; j += 2) {
      result.push_back(std::max(begin, kept[j]));
      result.push_back(std::min(end, kept[j + 1]));
    }
  }
}

}  // namespace

Reach reach_of(const PixelGrid& grid, std::int64_t x_nm, std::int64_t y_nm) {
  Reach reach;
  if (x_nm <= 0 && y_nm <= 0) return reach;
  const auto picometres = [](const PixelAxis& axis) {
    return std::llround(static_cast<double>(axis.span) * 1000 / static_cast<double>(axis.dots));
  };
  const __int128 px = picometres(grid.x), py = picometres(grid.y), x = x_nm, y = y_nm;
  const auto within = [&](std::int64_t i, std::int64_t j) {
    const __int128 along = i * px, across = j * py;  // picometres
    if (i == 0 || j == 0) return along <= x * 1000 && across <= y * 1000;
    if (x == 0 || y == 0) return false;
    if (x == y) return along * along + across * across <= x * x * 1'000'000;
    return along * along * y * y + across * across * x * x <= x * x * y * y * 1'000'000;
  };
  auto width = static_cast<std::int64_t>(x * 1000 / px);
  for (std::int64_t j = 0; within(0, j); ++j) {
    while (width > 0 && !within(width, j)) --width;
    reach.half_width.push_back(static_cast<std::uint32_t>(width));
  }
  return reach;
}

void erode(const RunsView& image, const Reach& reach, Runs& result) {
  const std::uint32_t rows = image.rows();
  result.columns = image.columns;
  result.row_offset.resize(std::size_t{rows} + 1);
  result.change.clear();
  const auto far = static_cast<std::int64_t>(reach.half_width.size()) - 1;
  Buffer<std::uint32_t> kept, next;
  for (std::int64_t r = 0; r < rows; ++r) {
    result.row_offset[static_cast<std::size_t>(r)] = static_cast<std::uint32_t>(result.change.size());
    if (r < far || r + far >= rows) continue;
    const Row own = image.row(static_cast<std::uint32_t>(r));
    kept.assign(own.begin(), own.end());
    // The farthest rows first: where they are empty, nothing else has to be read.
    for (std::int64_t j = far; j >= 0 && !kept.empty(); --j) {
      const std::uint32_t width = reach.half_width[static_cast<std::size_t>(j)];
      keep_inside(kept, image.row(static_cast<std::uint32_t>(r + j)), width, next);
      std::swap(kept, next);
      if (j == 0) break;
      keep_inside(kept, image.row(static_cast<std::uint32_t>(r - j)), width, next);
      std::swap(kept, next);
    }
    result.change.insert(result.change.end(), kept.begin(), kept.end());
  }
  result.row_offset[rows] = static_cast<std::uint32_t>(result.change.size());
}

}  // namespace lamina::dose
