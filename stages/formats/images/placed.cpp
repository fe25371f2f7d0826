#include "stages/formats/images/placed.h"

#include <algorithm>

namespace lamina::formats {
namespace {

/// The image's pixel that holds the centre of the pixel `place` behind the corner, at dots of the image in the bed's span.
std::int64_t source_of(std::int64_t position, std::int64_t dots, const PixelAxis& axis) {
  if (dots == axis.dots) return position;
  return (2 * position + 1) * dots / (2 * axis.dots);
}

}  // namespace

Placement placement_of(std::uint32_t columns, std::uint32_t rows, std::int64_t dots_x, std::int64_t dots_y,
                       const PixelGrid& grid, std::int64_t at_column, std::int64_t at_row) {
  Placement placement;
  placement.columns = grid.columns();
  placement.rows = grid.rows();
  for (std::uint32_t boundary = 0; boundary <= columns; ++boundary) {
    // The first place whose source is not before the boundary.
    const std::int64_t position = ceil_div(std::int64_t{boundary} * 2 * grid.x.dots - dots_x, 2 * dots_x);
    placement.column.push_back(static_cast<std::uint32_t>(std::clamp<std::int64_t>(at_column + position, 0, grid.columns())));
  }
  for (std::uint32_t r = 0; r < grid.rows(); ++r) {
    const std::int64_t behind = std::int64_t{grid.rows()} - 1 - r - at_row;  // rows from the image's front
    const std::int64_t source = behind < 0 ? rows : source_of(behind, dots_y, grid.y);
    if (source >= rows) {
      if (placement.row.empty()) ++placement.first_row;
      continue;
    }
    placement.row.push_back(rows - 1 - static_cast<std::uint32_t>(source));
  }
  return placement;
}

void position(const RunsView& image, const Placement& placement, Runs& out) {
  out.columns = placement.columns;
  out.change.clear();
  out.row_offset.assign(std::size_t{placement.rows} + 1, 0);
  const auto held = static_cast<std::uint32_t>(placement.row.size());
  for (std::uint32_t r = 0; r < held; ++r) {
    const auto row = image.row(placement.row[r]);
    const std::size_t begin = out.change.size();
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      const std::uint32_t from = placement.column[row[i]], to = placement.column[row[i + 1]];
      if (from == to) continue;
      if (out.change.size() > begin && out.change.back() == from) {
        out.change.back() = to;
      } else {
        out.change.push_back(from);
        out.change.push_back(to);
      }
    }
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
