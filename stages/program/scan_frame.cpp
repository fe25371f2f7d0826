#include "stages/program/scan_frame.h"

#include <algorithm>

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

/// Mirrors columns and turns the order of rows, each if asked for.
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

}  // namespace

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

}  // namespace lamina::program
