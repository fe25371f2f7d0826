// stages/data/levels.h: an image of whole levels as runs: drops a pixel, or how full a voxel is.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/runs.h"

namespace lamina {

/// Borrowed levels of one image.
///
/// row_offset  rows + 1 entries, first 0, last level.size(); row r owns the runs [row_offset[r], row_offset[r + 1])
/// change      two a run, increasing within a row: begin, end (exclusive), end <= columns. Runs do not overlap; where two
/// touch,
///             their levels differ
/// level       one a run, at least 1: where no run lies the level is 0
/// Rows are those of RunsView: row 0 is the back of the bed unless the image was mirrored.
struct LevelsView {
  std::uint32_t columns = 0;
  std::span<const std::uint32_t> row_offset;
  std::span<const std::uint32_t> change;
  std::span<const std::uint8_t> level;

  std::uint32_t rows() const { return row_offset.empty() ? 0 : static_cast<std::uint32_t>(row_offset.size() - 1); }
};

/// Owned levels; 4 bytes a row and 9 bytes a run.
struct Levels {
  std::uint32_t columns = 0;
  Buffer<std::uint32_t> row_offset;
  Buffer<std::uint32_t> change;
  Buffer<std::uint8_t> level;

  /// Makes it an image of no rows yet; end_row() ends each.
  void start(std::uint32_t width) {
    columns = width;
    row_offset.assign(1, 0);
    change.clear();
    level.clear();
  }
  /// Appends [begin, end) to the row that is being made; joins the run before it if both touch and are of one level.
  /// Nothing is appended where the level is 0 or the run is empty.
  void append(std::uint32_t begin, std::uint32_t end, std::uint8_t of_level) {
    if (of_level == 0 || begin >= end) return;
    if (level.size() > row_offset.back() && change.back() == begin && level.back() == of_level) {
      change.back() = end;
      return;
    }
    change.push_back(begin);
    change.push_back(end);
    level.push_back(of_level);
  }
  void end_row() { row_offset.push_back(static_cast<std::uint32_t>(level.size())); }

  LevelsView view() const { return {columns, row_offset, change, level}; }
  operator LevelsView() const { return view(); }
  std::uint64_t bytes() const { return bytes_held(row_offset) + bytes_held(change) + bytes_held(level); }
};

/// Sum of the levels of all pixels.
inline std::uint64_t sum_of_levels(const LevelsView& image) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < image.level.size(); ++i) {
    sum += std::uint64_t{image.change[2 * i + 1] - image.change[2 * i]} * image.level[i];
  }
  return sum;
}

/// Pixels of a level, or of any above 0.
inline std::uint64_t pixels_at(const LevelsView& image, std::uint8_t level = 0) {
  std::uint64_t pixels = 0;
  for (std::size_t i = 0; i < image.level.size(); ++i) {
    if (level == 0 || image.level[i] == level) pixels += image.change[2 * i + 1] - image.change[2 * i];
  }
  return pixels;
}

/// The highest level of any pixel; 0 of an empty image.
inline std::uint8_t highest(const LevelsView& image) {
  std::uint8_t maximum = 0;
  for (const std::uint8_t level : image.level) maximum = maximum < level ? level : maximum;
  return maximum;
}

/// The same of the pixels that the mask sets. mask  of the same size
inline std::uint64_t sum_of_levels(const LevelsView& image, const RunsView& mask) {
  std::uint64_t sum = 0;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto row = mask.row(r);
    std::size_t k = 0;
    for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i) {
      const std::uint32_t begin = image.change[2 * std::size_t{i}], end = image.change[2 * std::size_t{i} + 1];
      while (k + 1 < row.size() && row[k + 1] <= begin) k += 2;
      for (std::size_t j = k; j + 1 < row.size() && row[j] < end; j += 2)
        sum += std::uint64_t{std::min(end, row[j + 1]) - std::max(begin, row[j])} * image.level[i];
    }
  }
  return sum;
}

/// The pixels whose level is at least `least` (> 0): the plane of the drop of that number. No branch waits for a level.
inline void threshold_levels(const LevelsView& image, std::uint8_t minimum, Runs& plane) {
  const std::uint32_t rows = image.rows();
  plane.columns = image.columns;
  plane.row_offset.resize(std::size_t{rows} + 1);
  plane.row_offset[0] = 0;
  std::size_t used = 0;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::uint32_t first = image.row_offset[r], last = image.row_offset[r + 1];
    const std::size_t maximum = used + 2 * std::size_t{last - first} + 1;
    if (plane.change.size() < maximum)
      plane.change.resize(maximum < plane.change.capacity() ? plane.change.capacity() : 2 * maximum);
    std::uint32_t* change = plane.change.data() + used;
    std::uint32_t set = 0, end = 0;  // 1: the run before is taken; where it ends
    for (std::uint32_t i = first; i < last; ++i) {
      const std::uint32_t begin = image.change[2 * i];
      const std::uint32_t takes = image.level[i] >= minimum ? 1 : 0, joined = begin == end ? takes & set : 0;
      *change = end;
      change += set ^ joined;
      *change = begin;
      change += takes ^ joined;
      set = takes;
      end = image.change[2 * i + 1];
    }
    *change = end;
    change += set;
    used = static_cast<std::size_t>(change - plane.change.data());
    plane.row_offset[r + 1] = static_cast<std::uint32_t>(used);
  }
  plane.change.resize(used);
}

/// All set pixels at one level.
inline void levels_of(const RunsView& image, std::uint8_t of_level, Levels& result) {
  result.start(image.columns);
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto row = image.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) result.append(row[i], row[i + 1], of_level);
    result.end_row();
  }
}

}  // namespace lamina
