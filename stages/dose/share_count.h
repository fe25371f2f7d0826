// stages/dose/share_count.h: what a job of shares of voxels came to, summed over layers.
#pragma once

#include <cstdint>

namespace lamina::dose {

struct ShareCount {
  std::uint64_t full_voxels = 0;   // that the levels come to
  std::uint64_t half_differs = 0;  // of take_half(): voxels half full or more against pixels whose centre is set
  std::uint64_t half_far = 0;      // of these, those away from any boundary
  double differing_share() const {
    return full_voxels > 0 ? static_cast<double>(half_differs) / static_cast<double>(full_voxels) : 0;
  }
  void add(std::uint64_t more_full, std::uint64_t more_differs, std::uint64_t more_far) {
    full_voxels += more_full, half_differs += more_differs, half_far += more_far;
  }
};

}  // namespace lamina::dose
