#include "stages/program/lines.h"

#include <algorithm>
#include <utility>

#include "stages/geometry/drop_rows.h"

namespace lamina::program {
namespace {

/// Calls `visit(begin, end)` for the columns where exactly one of two rows is set.
template <class Visit>
void for_difference(std::span<const std::uint32_t> one, std::span<const std::uint32_t> other, const Visit& visit) {
  // The symmetric difference of two sets of ranges has the merged changes as its changes, pairs of equal ones left out.
  std::size_t i = 0, j = 0;
  std::uint32_t begin = 0;
  bool inside = false;
  while (i < one.size() || j < other.size()) {
    const bool take_one = j == other.size() || (i < one.size() && one[i] < other[j]);
    const bool both = i < one.size() && j < other.size() && one[i] == other[j];
    const std::uint32_t at = take_one || both ? one[i] : other[j];
    i += take_one || both;
    j += !take_one;
    if (both) continue;
    if (inside) visit(begin, at);
    begin = at;
    inside = !inside;
  }
}

/// Mirrors columns and reverses the order of rows, each if requested.
void mirror(const RunsView& image, bool columns, bool rows, Runs& result) {
  const std::uint32_t count = image.rows();
  result.columns = image.columns;
  result.row_offset.resize(std::size_t{count} + 1);
  result.change.resize(image.change.size());
  std::uint32_t next = 0;
  for (std::uint32_t r = 0; r < count; ++r) {
    result.row_offset[r] = next;
    const auto row = image.row(rows ? count - 1 - r : r);
    for (std::size_t i = 0; i < row.size(); ++i) {
      result.change[next++] = columns ? image.columns - row[row.size() - 1 - i] : row[i];
    }
  }
  result.row_offset[count] = next;
}

/// The same of levels.
void mirror(const LevelsView& image, bool columns, bool rows, Levels& result) {
  const std::uint32_t count = image.rows();
  result.start(image.columns);
  for (std::uint32_t r = 0; r < count; ++r) {
    const std::uint32_t from = rows ? count - 1 - r : r;
    const std::size_t first = image.row_offset[from], last = image.row_offset[from + 1];
    for (std::size_t k = first; k < last; ++k) {
      const std::size_t i = columns ? first + (last - 1 - k) : k;
      const std::uint32_t left = image.change[2 * i], right = image.change[2 * i + 1];
      result.append(columns ? image.columns - right : left, columns ? image.columns - left : right, image.level[i]);
    }
    result.end_row();
  }
}

/// Calls `visit(begin, end, above, here)` for the columns where the levels of a row differ from those of the row above.
template <class Visit>
void for_changed_levels(const LevelsView& image, std::uint32_t row, const Visit& visit) {
  struct Reader {
    std::size_t at, last;
  };
  const auto reader = [&](std::uint32_t r) {
    return r < image.rows() ? Reader{image.row_offset[r], image.row_offset[r + 1]} : Reader{0, 0};
  };
  Reader above = row > 0 ? reader(row - 1) : Reader{0, 0}, here = reader(row);
  // The level from a column on, and where it ends.
  const auto level_at = [&](Reader& of, std::uint32_t column, std::uint32_t& end) -> std::uint8_t {
    while (of.at < of.last && image.change[2 * of.at + 1] <= column) ++of.at;
    if (of.at == of.last) return 0;
    const bool inside = image.change[2 * of.at] <= column;
    end = std::min(end, image.change[2 * of.at + (inside ? 1 : 0)]);
    return inside ? image.level[of.at] : std::uint8_t{0};
  };
  for (std::uint32_t column = 0; column < image.columns;) {
    std::uint32_t end = image.columns;
    const std::uint8_t before = level_at(above, column, end), now = level_at(here, column, end);
    if (before != now) visit(column, end, before, now);
    column = end;
  }
}

/// A tile, and the pattern of a core, of an image of lines and positions: those of the image, turned.
void turn(const HeadGrid& grid, const DropPatterns& patterns, bool swapped, bool positions_reversed, DropPatterns& turned) {
  turned.zone = patterns.zone;
  turned.tile.assign(patterns.tile.size(), 0);
  for (std::size_t tile = 0; tile < patterns.tile.size(); tile += kTileWords) {
    for (std::uint32_t line = 0; line < kTileSide; ++line) {
      const std::uint32_t across = (grid.lines_from_end ? grid.lines - 1 - line : line) % kTileSide;
      for (std::uint32_t position = 0; position < kTileSide; ++position) {
        const std::uint32_t along = (positions_reversed ? grid.positions - 1 - position : position) % kTileSide;
        const std::uint32_t row = swapped ? along : across, column = swapped ? across : along;
        const std::uint64_t bit = patterns.tile[tile + std::size_t{2} * row + column / 64] >> (column % 64) & 1;
        turned.tile[tile + std::size_t{2} * line + position / 64] |= bit << (position % 64);
      }
    }
  }
  turned.core = patterns.core;
  CorePattern& core = turned.core;
  if (swapped) std::swap(core.column_step, core.row_step);
  const auto reverse = [&](std::uint32_t& step, std::uint32_t count) {
    core.first += (count - 1) * step;
    step = 0u - step;
  };
  if (grid.lines_from_end) reverse(core.row_step, grid.lines);
  if (positions_reversed) reverse(core.column_step, grid.positions);
  if (!core.words.empty()) tabulate(core);
}

}  // namespace

void transpose(const LevelsView& image, Levels& result, Buffer<std::uint32_t>& next) {
  const std::uint32_t rows = image.rows();
  result.columns = rows;
  result.row_offset.assign(std::size_t{image.columns} + 1, 0);
  // Count, scan, fill.
  for (std::uint32_t r = 0; r <= rows; ++r) {
    for_changed_levels(image, r, [&](std::uint32_t begin, std::uint32_t end, std::uint8_t, std::uint8_t now) {
      for (std::uint32_t c = begin; now > 0 && c < end; ++c) ++result.row_offset[c + 1];
    });
  }
  for (std::uint32_t c = 0; c < image.columns; ++c) result.row_offset[c + 1] += result.row_offset[c];
  next.assign(result.row_offset.begin(), result.row_offset.end());
  result.change.resize(std::size_t{2} * result.row_offset.back());
  result.level.resize(result.row_offset.back());
  for (std::uint32_t r = 0; r <= rows; ++r) {
    for_changed_levels(image, r, [&](std::uint32_t begin, std::uint32_t end, std::uint8_t before, std::uint8_t now) {
      for (std::uint32_t c = begin; c < end; ++c) {
        if (before > 0) result.change[2 * std::size_t{next[c]++} + 1] = r;
        if (now == 0) continue;
        result.change[2 * std::size_t{next[c]}] = r;
        result.level[next[c]] = now;
      }
    });
  }
}

DropImageView to_scan_frame(const HeadGrid& grid, const DropImageView& image, ScanScratch& scratch) {
  const bool swapped = grid.scan_axis != ScanAxis::kX;
  const bool reversed = swapped ? !grid.positions_from_end : grid.positions_from_end;
  if (!swapped && !grid.lines_from_end && !reversed) return image;
  if (!swapped) {
    mirror(image.zones, reversed, grid.lines_from_end, scratch.zones);
  } else {
    transpose(image.zones, scratch.zones, scratch.next);
    if (reversed || grid.lines_from_end) {
      Levels turned;
      mirror(scratch.zones, reversed, grid.lines_from_end, turned);
      std::swap(turned, scratch.zones);
    }
  }
  turn(grid, *image.patterns, swapped, reversed, scratch.patterns);
  return {scratch.zones, &scratch.patterns};
}

void transpose(const RunsView& image, Runs& result, Buffer<std::uint32_t>& next) {
  const std::uint32_t rows = image.rows();
  result.columns = rows;
  result.row_offset.assign(std::size_t{image.columns} + 1, 0);
  const auto above = [&](std::uint32_t r) { return r == 0 ? std::span<const std::uint32_t>() : image.row(r - 1); };
  const auto row_or_none = [&](std::uint32_t r) { return r == rows ? std::span<const std::uint32_t>() : image.row(r); };
  // Count, scan, fill.
  for (std::uint32_t r = 0; r <= rows; ++r) {
    for_difference(above(r), row_or_none(r), [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t c = begin; c < end; ++c) ++result.row_offset[c + 1];
    });
  }
  for (std::uint32_t c = 0; c < image.columns; ++c) result.row_offset[c + 1] += result.row_offset[c];
  next.assign(result.row_offset.begin(), result.row_offset.end());
  result.change.resize(result.row_offset.back());
  for (std::uint32_t r = 0; r <= rows; ++r) {
    for_difference(above(r), row_or_none(r), [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t c = begin; c < end; ++c) result.change[next[c]++] = r;
    });
  }
}

RunsView to_scan_frame(const HeadGrid& grid, const RunsView& image, ScanScratch& scratch) {
  if (grid.scan_axis == ScanAxis::kX) {
    if (!grid.lines_from_end && !grid.positions_from_end) return image;
    mirror(image, grid.positions_from_end, grid.lines_from_end, scratch.turned);
    return scratch.turned;
  }
  transpose(image, scratch.turned, scratch.next);
  if (!grid.positions_from_end || grid.lines_from_end) {
    Runs turned;
    mirror(scratch.turned, !grid.positions_from_end, grid.lines_from_end, turned);
    std::swap(turned, scratch.turned);
  }
  return scratch.turned;
}

void combine(ColumnChanges one, ColumnChanges other, LineOperation operation, Buffer<std::uint32_t>& result) {
  std::size_t i = 0, j = 0;
  bool before = false;
  while (i < one.size() || j < other.size()) {
    const std::uint32_t a = i < one.size() ? one[i] : UINT32_MAX, b = j < other.size() ? other[j] : UINT32_MAX;
    const std::uint32_t at = a < b ? a : b;
    i += a == at;
    j += b == at;
    const bool in_one = i % 2 == 1, in_other = j % 2 == 1;
    const bool inside = operation == LineOperation::kUnion ? in_one || in_other : in_one && !in_other;
    if (inside != before) result.push_back(at);
    before = inside;
  }
}

std::uint64_t pixels_of(ColumnChanges line) {
  std::uint64_t pixels = 0;
  for (std::size_t i = 0; i + 1 < line.size(); i += 2) pixels += line[i + 1] - line[i];
  return pixels;
}

void divide(ColumnChanges line, std::uint64_t number, std::uint32_t share, bool upper, Buffer<std::uint32_t>& result) {
  for (std::size_t i = 0; i + 1 < line.size(); i += 2) {
    bool before = false;
    for (std::uint32_t position = line[i]; position < line[i + 1]; ++position) {
      const bool fires = upper_fires(number, position, share) == upper;
      if (fires != before) result.push_back(position);
      before = fires;
    }
    if (before) result.push_back(line[i + 1]);
  }
}

std::uint64_t allowed_positions(std::uint64_t number, std::uint32_t share, bool upper) {
  std::uint64_t allowed = 0;
  for (std::uint32_t position = 0; position < 64; ++position) {
    if (upper_fires(number, position, share) == upper) allowed |= std::uint64_t{1} << position;
  }
  return allowed;
}

}  // namespace lamina::program
