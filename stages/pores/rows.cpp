#include "stages/pores/rows.h"

#include <array>

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

}  // namespace lamina::pores
