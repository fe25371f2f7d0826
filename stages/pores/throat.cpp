#include "stages/pores/throat.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stages/pores/parts.h"
#include "stages/pores/rows.h"

namespace lamina::pores {
namespace {

class Passage {
 public:
  Passage(const VoxelView& solid, const VoxelWindow& window) : distances_(distances(solid, window)) {
    box_.nx = window.size(0), box_.ny = window.size(1), box_.nz = window.size(2);
    box_.periodic = distances_.periodic;
    const Nm longest = std::max({solid.edge[0], solid.edge[1], solid.edge[2]});
    cubes_ = longest == distances_.unit;
    wall_ = static_cast<double>(longest) / static_cast<double>(distances_.unit);
    for (const float squared : distances_.squared) max_ = std::max(max_, squared);
  }

  double diameter_mm(int axis) {
    if (box_.voxels() == 0) return 0;
    if (max_ == std::numeric_limits<float>::infinity()) return max_;
    const double parts = cubes_ ? 1 : 64;  // of a squared unit; distances of cubes are whole
    // Through at `low`, not at `high`.
    auto low = std::int64_t{0}, high = static_cast<std::int64_t>(std::floor(max_ * parts)) + 1;
    while (high - low > 1) {
      const std::int64_t middle = low + (high - low) / 2;
      (leads_through(static_cast<float>(static_cast<double>(middle) / parts), axis) ? low : high) = middle;
    }
    if (low == 0) return 0;
    const double diameter = 2 * std::sqrt(static_cast<double>(low) / parts) - wall_;
    return std::max(0.0, diameter * mm(distances_.unit));
  }

 private:
  bool leads_through(float minimum, int axis) {
    const float* const squared = distances_.squared.data();
    const std::uint32_t nx = box_.nx;
    make_rows(box_, far_, [&](std::size_t r, const auto& take) {
      const float* const row = squared + r * nx;
      bool before = false;
      for (std::uint32_t x = 0; x < nx; ++x) {
        const bool now = row[x] >= minimum;
        if (now != before) take(x);
        before = now;
      }
      if (before) take(nx);
    });
    const Parts parts = parts_of(far_);
    for (std::size_t p = 0; p < parts.size(); ++p) {
      if (parts.through(p, axis)) return true;
    }
    return false;
  }

  Distances distances_;
  VoxelView box_;
  VoxelStack far_;
  bool cubes_ = true;
  double wall_ = 1;
  float max_ = 0;
};

}  // namespace

std::array<double, 3> throats(const VoxelView& solid, const VoxelWindow& window, std::array<bool, 3> axes) {
  Passage passage(solid, window);
  std::array<double, 3> diameters{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (axes[axis]) diameters[axis] = passage.diameter_mm(static_cast<int>(axis));
  }
  return diameters;
}

}  // namespace lamina::pores
