#include "stages/pores/rows.h"

namespace lamina::pores {
namespace {

VoxelStack combined(const VoxelView& a, const VoxelView& b, Operation operation) {
  VoxelStack out;
  make_rows(a, out, [&](std::size_t r, const auto& take) { combine_rows(a.row(r), b.row(r), operation, take); });
  return out;
}

}  // namespace

VoxelStack void_of(const VoxelView& solid, const VoxelView* body) {
  VoxelStack out;
  const std::array<std::uint32_t, 2> all{0, solid.nx};
  make_rows(solid, out, [&](std::size_t r, const auto& take) {
    combine_rows(body == nullptr ? Row(all) : body->row(r), solid.row(r), Operation::kDifference, take);
  });
  return out;
}

VoxelStack both_of(const VoxelView& one, const VoxelView& other) { return combined(one, other, Operation::kIntersection); }

VoxelStack without(const VoxelView& one, const VoxelView& other) { return combined(one, other, Operation::kDifference); }

void add_to_blocks(Row row, std::uint32_t offset, std::uint32_t columns, std::int32_t sign, std::uint32_t side,
                   std::span<std::int32_t> blocks) {
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    const std::uint32_t end = std::min(std::max(row[i + 1], offset) - offset, columns);
    for (std::uint32_t at = std::max(row[i], offset) - offset; at < end;) {
      const std::uint32_t next = std::min(end, (at / side + 1) * side);
      blocks[at / side] += sign * static_cast<std::int32_t>(next - at);
      at = next;
    }
  }
}

VoxelStack coarser(const VoxelView& box, const std::array<std::uint32_t, 3>& factor) {
  VoxelStack out(box.nx / factor[0], box.ny / factor[1], box.edge, box.periodic);
  for (std::size_t a = 0; a < 3; ++a) out.edge[a] *= static_cast<Nm>(factor[a]);
  const auto block = static_cast<std::int64_t>(factor[0] * factor[1] * factor[2]);
  Buffer<std::int32_t> count(out.nx);
  Runs slice;
  slice.columns = out.nx;
  for (std::uint32_t z = 0; z < box.nz / factor[2]; ++z) {
    slice.row_offset.assign(1, 0);
    slice.change.clear();
    for (std::uint32_t y = 0; y < out.ny; ++y) {
      std::ranges::fill(count, 0);
      for (std::uint32_t k = 0; k < factor[2]; ++k)
        for (std::uint32_t j = 0; j < factor[1]; ++j)
          add_to_blocks(box.row(y * factor[1] + j, z * factor[2] + k), 0, out.nx * factor[0], 1, factor[0], count);
      const auto first = box.row(y * factor[1], z * factor[2]);
      std::size_t passed = 0;  // changes of the first row
      bool before = false;
      for (std::uint32_t x = 0; x < out.nx; ++x) {
        while (passed < first.size() && first[passed] <= x * factor[0]) ++passed;
        const std::int64_t twice = 2 * std::int64_t{count[x]};
        const bool set = twice == block ? passed % 2 == 1 : twice > block;
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
