#include "stages/pores/coarser.h"

#include <algorithm>

namespace lamina::pores {
namespace {

/// Adds a row's set voxels to the counts of blocks along x.
void count_row(std::span<const std::uint32_t> row, std::uint32_t factor, std::span<std::uint32_t> count) {
  const std::uint32_t reach = static_cast<std::uint32_t>(count.size()) * factor;
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    for (std::uint32_t at = row[i], end = std::min(row[i + 1], reach); at < end;) {
      const std::uint32_t next = std::min(end, (at / factor + 1) * factor);
      count[at / factor] += next - at;
      at = next;
    }
  }
}

}  // namespace

VoxelStack coarser(const VoxelView& box, const std::array<std::uint32_t, 3>& factor) {
  VoxelStack out(box.nx / factor[0], box.ny / factor[1], box.edge, box.periodic);
  for (std::size_t a = 0; a < 3; ++a) out.edge[a] *= static_cast<Nm>(factor[a]);
  const std::uint32_t block = factor[0] * factor[1] * factor[2];
  Buffer<std::uint32_t> count(out.nx);
  Runs slice;
  slice.columns = out.nx;
  for (std::uint32_t z = 0; z < box.nz / factor[2]; ++z) {
    slice.row_offset.assign(1, 0);
    slice.change.clear();
    for (std::uint32_t y = 0; y < out.ny; ++y) {
      std::ranges::fill(count, 0u);
      for (std::uint32_t k = 0; k < factor[2]; ++k)
        for (std::uint32_t j = 0; j < factor[1]; ++j)
          count_row(box.row(y * factor[1] + j, z * factor[2] + k), factor[0], count);
      const auto first = box.row(y * factor[1], z * factor[2]);
      std::size_t passed = 0;  // changes of the first row
      bool before = false;
      for (std::uint32_t x = 0; x < out.nx; ++x) {
        while (passed < first.size() && first[passed] <= x * factor[0]) ++passed;
        const bool set = 2 * count[x] == block ? passed % 2 == 1 : 2 * count[x] > block;
        if (set != before) slice.change.push_back(x);
        before = set;
      }
      if (before) slice.change.push_back(out.nx);
      slice.row_offset.push_back(static_cast<std::uint32_t>(slice.change.size()));
    }
    out.append(slice);
  }
  return out;
}

}  // namespace lamina::pores
