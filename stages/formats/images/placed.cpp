#include "stages/formats/images/placed.h"

#include <algorithm>

namespace lamina::formats {
namespace {

/// Pixels of an image along an axis of the bed, (2 p + 1) * image / (2 bed) of them up to the centre of the bed's pixel p.
struct Scale {
  __int128 image, bed;
  Scale(const DotPitch& pitch, const PixelAxis& axis)
      : image(__int128{pitch.dots} * axis.span), bed(__int128{axis.dots} * pitch.span) {}

  /// The image's pixel that holds the centre of the pixel `position` behind the corner.
  std::int64_t source(std::int64_t position) const {
    return image == bed ? position : static_cast<std::int64_t>((2 * position + 1) * image / (2 * bed));
  }
  /// The first position whose source is not before the image's pixel `boundary`.
  std::int64_t first(std::int64_t boundary) const {
    return static_cast<std::int64_t>(ceil_div<__int128>(boundary * 2 * bed - image, 2 * image));
  }
};

}  // namespace

Placement placement_of(std::uint32_t columns, std::uint32_t rows, const DotPitch& x, const DotPitch& y, const PixelGrid& grid,
                       std::int64_t at_column, std::int64_t at_row) {
  const Scale along(x, grid.x), across(y, grid.y);
  Placement placement;
  placement.columns = grid.columns();
  placement.rows = grid.rows();
  for (std::uint32_t boundary = 0; boundary <= columns; ++boundary) {
    const std::int64_t column = at_column + along.first(boundary);
    placement.column.push_back(static_cast<std::uint32_t>(std::clamp<std::int64_t>(column, 0, grid.columns())));
  }
  for (std::uint32_t r = 0; r < grid.rows(); ++r) {
    const std::int64_t behind = std::int64_t{grid.rows()} - 1 - r - at_row;  // rows from the image's front
    const std::int64_t source = behind < 0 ? rows : across.source(behind);
    if (source >= rows) {
      if (placement.row.empty()) ++placement.first_row;
      continue;
    }
    placement.row.push_back(rows - 1 - static_cast<std::uint32_t>(source));
  }
  return placement;
}

namespace {

/// Adds a row's runs as they are on the bed to those of `out` from `begin` on, which are of the same row.
void append_row(std::span<const std::uint32_t> row, const Placement& placement, std::size_t begin, Buffer<std::uint32_t>& out) {
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    const std::uint32_t from = placement.column[row[i]], to = placement.column[row[i + 1]];
    if (from == to) continue;
    if (out.size() > begin && out.back() == from) {
      out.back() = to;
    } else {
      out.push_back(from);
      out.push_back(to);
    }
  }
}

}  // namespace

void position(const BitRows& image, const Placement& placement, RunsBuilder& out) {
  RowRuns rows(image);
  Buffer<std::uint32_t> row;
  for (std::uint32_t r = 0; r < placement.rows; ++r) {
    row.clear();
    if (r >= placement.first_row && r - placement.first_row < placement.row.size())
      append_row(rows.row(placement.row[r - placement.first_row]), placement, 0, row);
    out.add_changes(row);
  }
}

void position(const RunsView& image, const Placement& placement, Runs& out) {
  out.columns = placement.columns;
  out.change.clear();
  out.row_offset.assign(std::size_t{placement.rows} + 1, 0);
  const auto held = static_cast<std::uint32_t>(placement.row.size());
  for (std::uint32_t r = 0; r < held; ++r) {
    append_row(image.row(placement.row[r]), placement, out.change.size(), out.change);
    out.row_offset[placement.first_row + r + 1] = static_cast<std::uint32_t>(out.change.size());
  }
  std::fill(out.row_offset.begin() + placement.first_row + held + 1, out.row_offset.end(),
            static_cast<std::uint32_t>(out.change.size()));
}

void position(const LevelsView& image, const Placement& placement, Levels& out) {
  out.start(placement.columns);
  const auto held = static_cast<std::uint32_t>(placement.row.size());
  for (std::uint32_t r = 0; r < placement.rows; ++r) {
    if (r >= placement.first_row && r - placement.first_row < held) {
      const std::uint32_t from = placement.row[r - placement.first_row];
      for (std::uint32_t i = image.row_offset[from]; i < image.row_offset[from + 1]; ++i)
        out.append(placement.column[image.change[2 * i]], placement.column[image.change[2 * i + 1]], image.level[i]);
    }
    out.end_row();
  }
}

}  // namespace lamina::formats
