#include "stages/program/lines.h"

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

void DropBits::begin(std::uint32_t bits) {
  bits_ = bits;
  for (std::uint32_t bit = 0; bit < bits; ++bit) {
    change_[bit].clear();
    end_[bit].clear();
  }
}

void DropBits::add(std::span<const ColumnChanges> drops) {
  next_.assign(drops.size(), 0);
  std::uint32_t before = 0;
  for (;;) {
    std::uint32_t at = UINT32_MAX, number = 0;
    for (std::size_t k = 0; k < drops.size(); ++k) {
      if (next_[k] < drops[k].size()) at = std::min(at, drops[k][next_[k]]);
    }
    if (at == UINT32_MAX) break;
    for (std::size_t k = 0; k < drops.size(); ++k) {
      next_[k] += next_[k] < drops[k].size() && drops[k][next_[k]] == at;
      number += static_cast<std::uint32_t>(next_[k] % 2);
    }
    for (std::uint32_t bit = 0; bit < bits_; ++bit) {
      if (((number ^ before) >> bit & 1) != 0) change_[bit].push_back(at);
    }
    before = number;
  }
  for (std::uint32_t bit = 0; bit < bits_; ++bit) end_[bit].push_back(static_cast<std::uint32_t>(change_[bit].size()));
}

void DropBits::end(std::span<ColumnChanges> nozzle) const {
  for (std::uint32_t bit = 0; bit < bits_; ++bit) {
    const ColumnChanges all(change_[bit].data(), change_[bit].size());
    const std::size_t nozzles = end_[bit].size();
    std::uint32_t begin = 0;
    for (std::size_t i = 0; i < nozzles; ++i) {
      nozzle[bit * nozzles + i] = all.subspan(begin, end_[bit][i] - begin);
      begin = end_[bit][i];
    }
  }
}

std::uint64_t DropBits::bytes() const {
  std::uint64_t total = 0;
  for (std::uint32_t bit = 0; bit < kMax; ++bit) total += bytes_held(change_[bit]) + bytes_held(end_[bit]);
  return total;
}

}  // namespace lamina::program
