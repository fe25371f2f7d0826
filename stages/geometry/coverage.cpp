#include "stages/geometry/coverage.h"

#include <algorithm>
#include <vector>

namespace lamina {
namespace {

/// Image: RowRuns or LevelsView; row  begin and end of each run of a row
template <class Image, class Row>
PixelWindow window_of_rows(const Image& image, Row row) {
  PixelWindow window{UINT32_MAX, 0, UINT32_MAX, 0};
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const std::span<const std::uint32_t> runs = row(r);
    if (runs.empty()) continue;
    window.left = std::min(window.left, runs.front());
    window.right = std::max(window.right, runs.back());
    window.top = std::min(window.top, r);
    window.bottom = r + 1;
  }
  return window.right == 0 ? PixelWindow{} : window;
}

std::span<const std::uint32_t> runs_of(const LevelsView& levels, std::uint32_t row) {
  const std::size_t first = levels.row_offset[row], last = levels.row_offset[row + 1];
  return levels.change.subspan(2 * first, 2 * (last - first));
}

/// One row of results. Lengths along x are in units of 1 / columns of a pixel, so that a pixel is `columns` units and a
/// part is `window.width()` units, whole numbers both.
class PartRow {
 public:
  PartRow(const PixelWindow& window, std::uint32_t columns)
      : left_(window.left),
        right_(window.right),
        pixel_(columns),
        part_(window.width()),
        edge_(columns + 1, 0),
        inside_(columns + 1, 0) {}

  /// Adds a row of pixels, of which `weight` units of height lie in this row of parts.
  /// level_of  how much of it a run has
  template <class LevelOf>
  void add(std::span<const std::uint32_t> row, std::uint64_t weight, LevelOf level_of) {
    for (std::size_t i = 0; i < row.size(); i += 2) {
      if (row[i + 1] <= left_) continue;
      if (row[i] >= right_) break;
      add_run(std::max(row[i], left_) - left_, std::min(row[i + 1], right_) - left_, weight * level_of(i / 2));
    }
  }

  /// Gives the shares of parts of `height` units and starts anew.
  void take(std::uint64_t height, std::span<std::uint8_t> shares) {
    const std::uint64_t whole = part_ * height;
    std::int64_t through = 0;
    for (std::size_t i = 0; i < shares.size(); ++i) {
      through += inside_[i];
      const std::uint64_t area = edge_[i] + static_cast<std::uint64_t>(through);
      shares[i] = static_cast<std::uint8_t>((area * 255 + whole / 2) / whole);
    }
    std::fill(edge_.begin(), edge_.end(), 0);
    std::fill(inside_.begin(), inside_.end(), 0);
  }

 private:
  /// Pixels [from, to) of the window.
  void add_run(std::uint64_t from, std::uint64_t to, std::uint64_t weight) {
    const std::uint64_t begin = from * pixel_, end = to * pixel_;
    const std::uint64_t first = begin / part_, last = end / part_;
    if (first == last) {
      edge_[first] += (end - begin) * weight;
      return;
    }
    // Part of the first one, part of the last one (nothing if the run ends where it begins), and all between.
    edge_[first] += ((first + 1) * part_ - begin) * weight;
    edge_[last] += (end - last * part_) * weight;
    inside_[first + 1] += static_cast<std::int64_t>(part_ * weight);
    inside_[last] -= static_cast<std::int64_t>(part_ * weight);
  }

  std::uint32_t left_, right_;
  std::uint64_t pixel_, part_;        // units
  std::vector<std::uint64_t> edge_;   // area of runs that begin or end within a part
  std::vector<std::int64_t> inside_;  // change of the area that runs cover from one part to the next
};

/// full  what a pixel has at most; add_row(r, weight, part_row) adds a row of pixels
template <class AddRow>
void fill_parts(const PixelWindow& window, std::uint32_t columns, std::uint64_t full, std::span<std::uint8_t> result,
                AddRow add_row) {
  const std::uint64_t part_rows = result.size() / columns, pixel_rows = window.height();
  PartRow part_row(window, columns);
  for (std::uint64_t part = 0; part < part_rows; ++part) {
    // In units of 1 / part_rows of a pixel's height.
    const std::uint64_t top = part * pixel_rows, bottom = top + pixel_rows;
    for (std::uint64_t r = top / part_rows; r * part_rows < bottom; ++r) {
      const std::uint64_t weight = std::min((r + 1) * part_rows, bottom) - std::max(r * part_rows, top);
      add_row(window.top + static_cast<std::uint32_t>(r), weight, part_row);
    }
    part_row.take(pixel_rows * full, result.subspan(static_cast<std::size_t>(part) * columns, columns));
  }
}

}  // namespace

PixelWindow window_of(RowRuns image) {
  return window_of_rows(image, [&](std::uint32_t r) { return image.row(r); });
}

PixelWindow window_of(const LevelsView& levels) {
  return window_of_rows(levels, [&](std::uint32_t r) { return runs_of(levels, r); });
}

PixelWindow joined(const PixelWindow& one, const PixelWindow& other) {
  if (one.empty()) return other;
  if (other.empty()) return one;
  return {std::min(one.left, other.left), std::max(one.right, other.right), std::min(one.top, other.top),
          std::max(one.bottom, other.bottom)};
}

void box_coverage(RowRuns image, const PixelWindow& window, std::uint32_t columns, std::span<std::uint8_t> result) {
  fill_parts(window, columns, 1, result, [&](std::uint32_t r, std::uint64_t weight, PartRow& part_row) {
    part_row.add(image.row(r), weight, [](std::size_t) { return std::uint64_t{1}; });
  });
}

void box_coverage(std::span<const BitRows* const> planes, std::uint32_t full, const PixelWindow& window, std::uint32_t columns,
                  std::span<std::uint8_t> result) {
  std::vector<RowRuns> images;
  for (const BitRows* const plane : planes) images.emplace_back(*plane);
  fill_parts(window, columns, full, result, [&](std::uint32_t r, std::uint64_t weight, PartRow& part_row) {
    for (RowRuns& image : images) part_row.add(image.row(r), weight, [](std::size_t) { return std::uint64_t{1}; });
  });
}

void box_coverage(const LevelsView& levels, std::uint8_t full, const PixelWindow& window, std::uint32_t columns,
                  std::span<std::uint8_t> result) {
  fill_parts(window, columns, full, result, [&](std::uint32_t r, std::uint64_t weight, PartRow& part_row) {
    const std::uint8_t* level = levels.level.data() + levels.row_offset[r];
    part_row.add(runs_of(levels, r), weight, [&](std::size_t run) { return std::uint64_t{level[run]}; });
  });
}

}  // namespace lamina
