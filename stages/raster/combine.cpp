#include "stages/raster/combine.h"

namespace lamina::raster {

void combine(const RunsView& a, const RunsView& b, Combine how, Runs& out) {
  out.columns = a.columns;
  out.row_offset.resize(std::size_t{a.rows()} + 1);
  out.change.resize(a.change.size() + b.change.size());
  out.row_offset[0] = 0;
  std::uint32_t* next = out.change.data();
  const unsigned needed = how == Combine::kBoth ? 2 : 1;
  for (std::uint32_t r = 0; r < a.rows(); ++r) {
    const auto first = a.row(r), second = b.row(r);
    // Every change turns its image on or off; what matters is how many images are on.
    for (std::size_t i = 0, j = 0; i < first.size() || j < second.size();) {
      const unsigned before = (i & 1) + (j & 1);
      const std::uint32_t column = j == second.size() || (i < first.size() && first[i] < second[j]) ? first[i] : second[j];
      if (i < first.size() && first[i] == column) ++i;
      if (j < second.size() && second[j] == column) ++j;
      const unsigned after = (i & 1) + (j & 1);
      if ((before >= needed) != (after >= needed)) *next++ = column;
    }
    out.row_offset[r + 1] = static_cast<std::uint32_t>(next - out.change.data());
  }
  out.change.resize(static_cast<std::size_t>(next - out.change.data()));
}

}  // namespace lamina::raster
