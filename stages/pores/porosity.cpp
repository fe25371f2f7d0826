#include "stages/pores/porosity.h"

#include "stages/pores/rows.h"

namespace lamina::pores {

Porosity porosity(const VoxelView& solid, const VoxelView* body, Faces outside) {
  Porosity result;
  const VoxelStack empty = void_of(solid, body);
  const Parts parts = parts_of(empty);
  Buffer<std::uint8_t> open(parts.size(), std::uint8_t{0});
  if (body != nullptr) open = adjacent_parts(empty, parts, without(void_of(solid), *body));
  result.body = body == nullptr ? solid.voxels() : set_voxels(*body);
  result.voxel_mm3 = mm(solid.edge[0]) * mm(solid.edge[1]) * mm(solid.edge[2]);
  result.parts = static_cast<std::uint32_t>(parts.size());
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const bool is_open = open[p] != 0 || parts.is_reached(p, outside);
    for (int axis = 0; axis < 3; ++axis)
      if (parts.through(p, axis)) result.through[static_cast<std::size_t>(axis)] += parts.voxels[p];
    result.empty += parts.voxels[p];
    if (is_open) result.open += parts.voxels[p];
    if (!is_open) ++result.cavities;
  }
  return result;
}

VoxelStack void_through(const VoxelView& solid, int axis) {
  const VoxelStack empty = void_of(solid);
  const Parts parts = parts_of(empty);
  VoxelStack result;
  make_rows(empty, result, [&](std::size_t r, const auto& take) {
    for (std::uint32_t i = empty.row_offset[r]; i < empty.row_offset[r + 1]; i += 2) {
      if (!parts.through(parts.part_of(i / 2), axis)) continue;
      take(empty.change[i]);
      take(empty.change[i + 1]);
    }
  });
  return result;
}

}  // namespace lamina::pores
