#include "stages/raster/mirror.h"

namespace lamina::raster {

void mirror(const RunsView& runs, bool x, bool y, Runs& out) {
  const std::uint32_t rows = runs.rows();
  out.columns = runs.columns;
  out.row_offset.resize(std::size_t{rows} + 1);
  out.change.resize(runs.change.size());
  out.row_offset[0] = 0;
  std::uint32_t* next = out.change.data();
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto row = runs.row(y ? rows - 1 - r : r);
    if (x) {
      for (std::size_t i = row.size(); i-- > 0;) *next++ = runs.columns - row[i];
    } else {
      for (const std::uint32_t column : row) *next++ = column;
    }
    out.row_offset[r + 1] = static_cast<std::uint32_t>(next - out.change.data());
  }
}

}  // namespace lamina::raster
