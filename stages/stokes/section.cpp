#include "stages/stokes/section.h"

#include <cmath>
#include <limits>

namespace lamina::stokes {
namespace {

using At = std::array<std::uint32_t, 3>;

/// In the middle of a cell: the mean of its two faces.
double velocity(const Cells& cells, const Field& u, std::uint32_t i, std::size_t axis) {
  const int a = static_cast<int>(axis);
  return 0.5 * (double{u[i][a]} + u[cells.neighbour[i][2 * axis]][a]);
}

double speed(const Cells& cells, const Field& u, std::uint32_t i) {
  double squared = 0;
  for (std::size_t a = 0; a < 3; ++a) squared += velocity(cells, u, i, a) * velocity(cells, u, i, a);
  return std::sqrt(squared);
}

/// Voxels that something flows in, around a place of a plane, along its columns or its rows.
std::uint32_t chord(const Plane& plane, std::uint32_t column, std::uint32_t row, bool along_columns) {
  const std::uint32_t maximum = along_columns ? plane.columns : plane.rows, from = along_columns ? column : row;
  const auto flows = [&](std::uint32_t i) {
    const std::uint32_t c = along_columns ? i : column, r = along_columns ? row : i;
    return plane.value[c + std::size_t{plane.columns} * r] != 0;
  };
  std::uint32_t low = from, high = from;
  while (low > 0 && flows(low - 1)) --low;
  while (high + 1 < maximum && flows(high + 1)) ++high;
  return high - low + 1;
}

/// value(i)  of cell i
template <class Value>
Plane plane_of(const Buffer<At>& positions, const At& size, const At& through, int normal, const Value& value) {
  const auto n = static_cast<std::size_t>(normal), c = static_cast<std::size_t>(column_axis(normal)),
             r = static_cast<std::size_t>(row_axis(normal));
  Plane plane{normal, through[n], size[c], size[r], {}};
  plane.value.assign(std::size_t{size[c]} * size[r], 0.0f);
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    const At& at = positions[i];
    if (at[n] == through[n] && at[c] < size[c] && at[r] < size[r])
      plane.value[at[c] + std::size_t{size[c]} * at[r]] = static_cast<float>(value(i));
  }
  return plane;
}

}  // namespace

Section section_of(CellPositions turned, const Cells& cells, const Field& field, double mean, std::uint32_t ends) {
  const int axis = turned.axis;
  const auto a = static_cast<std::size_t>(axis), lane = static_cast<std::size_t>(turned.lane);
  Buffer<At>& positions = turned.at;
  At size = turned.size;
  size[a] -= 2 * ends;
  Section section{.size = size, .fastest = {}, .across = {}, .along = {}};
  double maximum = -std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    positions[i][a] -= ends;  // what lies before the first end becomes larger than any size
    if (positions[i][a] >= size[a]) continue;
    const double here = velocity(cells, field, i, lane);
    if (here < maximum || (here == maximum && positions[i] > section.fastest)) continue;
    maximum = here;
    section.fastest = positions[i];
  }
  section.across =
      plane_of(positions, size, section.fastest, axis, [&](std::uint32_t i) { return velocity(cells, field, i, lane) / mean; });
  const int column = column_axis(axis), row = row_axis(axis);
  const std::uint32_t at_column = section.fastest[static_cast<std::size_t>(column)],
                      at_row = section.fastest[static_cast<std::size_t>(row)];
  const bool narrow_along_row =
      chord(section.across, at_column, at_row, false) < chord(section.across, at_column, at_row, true);
  section.along = plane_of(positions, size, section.fastest, narrow_along_row ? column : row,
                           [&](std::uint32_t i) { return speed(cells, field, i) / mean; });
  return section;
}

}  // namespace lamina::stokes
