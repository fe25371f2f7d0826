#include "stages/geometry/blocks/block_order.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/geometry/blocks/cluster.h"

namespace lamina {
namespace {

/// The height of the middle of each facet, and what the order needs to know of all, nm.
struct Heights {
  std::array<Nm, kBlockSize> middle;
  Nm lowest = INT32_MAX, highest = INT32_MIN;  // of the middles
  Nm front = INT32_MAX, back = INT32_MIN;      // y of the first corners
  std::int64_t sum = 0;                        // of the facets' own heights

  explicit Heights(std::span<const Triangle> block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const Triangle& t = block[i];
      const Nm lo = std::min(t.a.z, std::min(t.b.z, t.c.z)), hi = std::max(t.a.z, std::max(t.b.z, t.c.z));
      middle[i] = (lo >> 1) + (hi >> 1);
      lowest = std::min(lowest, middle[i]);
      highest = std::max(highest, middle[i]);
      front = std::min(front, t.a.y);
      back = std::max(back, t.a.y);
      sum += std::int64_t{hi} - lo;
    }
  }
};

/// Where a triangle stands in the order of its block: by height in steps, then along y. 15 bits.
///
/// A job's planes and beams visit a cluster as often as its height times its depth says, the latter blurred by what a beam is
/// deep; how wide it is costs nothing. Of mean facets h high in a block H high and D deep, that is least at the step below.
class BlockOrder {
 public:
  BlockOrder(const Heights& heights, std::size_t count) : lowest_(heights.lowest), front_(heights.front) {
    const double height = static_cast<double>(std::int64_t{heights.highest} - lowest_);
    const double depth = static_cast<double>(std::int64_t{heights.back} - front_);
    const double mean = static_cast<double>(heights.sum) / static_cast<double>(count);
    const double clusters = static_cast<double>(count) / kClusterSize;
    const double step = std::max(std::sqrt(height * depth * mean / (clusters * kBeam)), mean / 4);
    steps_a_nm_ = static_cast<float>(1 / std::max(step, height / (kSteps - 2) + 1));
    rows_a_nm_ = static_cast<float>(kRows / (depth + 1));
  }

  std::uint16_t operator()(Nm middle, Nm y) const {
    const auto step = static_cast<std::int32_t>(static_cast<float>(std::int64_t{middle} - lowest_) * steps_a_nm_);
    const auto row = static_cast<std::int32_t>(static_cast<float>(std::int64_t{y} - front_) * rows_a_nm_);
    return static_cast<std::uint16_t>(step << 6 | std::min(row, kRows - 1));
  }

 private:
  static constexpr std::int32_t kSteps = 1 << 9, kRows = 64;
  static constexpr double kBeam = 2e6;  // nm
  std::int64_t lowest_, front_;
  float steps_a_nm_, rows_a_nm_;
};

}  // namespace

void order_block(std::span<const Triangle> block, std::span<std::uint16_t> order) {
  const Heights heights(block);
  const BlockOrder place(heights, block.size());
  std::array<std::uint16_t, kBlockSize> key, first_order;
  std::array<std::uint16_t, 257> low{}, high{};
  const auto count = static_cast<std::uint32_t>(block.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    key[i] = place(heights.middle[i], block[i].a.y);
    ++low[(key[i] & 255) + 1u];
    ++high[(key[i] >> 8) + 1u];
  }
  for (std::uint32_t b = 0; b < 256; ++b) {
    low[b + 1] = static_cast<std::uint16_t>(low[b + 1] + low[b]);
    high[b + 1] = static_cast<std::uint16_t>(high[b + 1] + high[b]);
  }
  for (std::uint32_t i = 0; i < count; ++i) first_order[low[key[i] & 255]++] = static_cast<std::uint16_t>(i);
  for (std::uint32_t i = 0; i < count; ++i) order[high[key[first_order[i]] >> 8]++] = first_order[i];
}

}  // namespace lamina
