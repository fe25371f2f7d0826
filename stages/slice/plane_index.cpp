#include "stages/slice/plane_index.h"

#include <algorithm>

namespace lamina::slice {
namespace {

/// Finds the first plane at or above a height: a table of equal steps leads to the place, comparisons decide.
class PlaneFinder {
 public:
  explicit PlaneFinder(std::span<const std::int64_t> planes) : planes_(planes) {
    if (planes.empty()) return;
    const auto range = static_cast<std::uint64_t>(planes.back() - planes.front());
    while ((range >> shift_) > 4 * planes.size()) ++shift_;
    place_.resize(static_cast<std::size_t>(range >> shift_) + 1);
    std::uint32_t plane = 0;
    for (std::size_t cell = 0; cell < place_.size(); ++cell) {
      while (planes[plane] < planes.front() + static_cast<std::int64_t>(cell << shift_)) ++plane;
      place_[cell] = plane;
    }
  }

  std::uint32_t operator()(std::int64_t z) const {
    if (planes_.empty() || z <= planes_.front()) return 0;
    if (z > planes_.back()) return static_cast<std::uint32_t>(planes_.size());
    std::uint32_t plane = place_[static_cast<std::size_t>(static_cast<std::uint64_t>(z - planes_.front()) >> shift_)];
    while (planes_[plane] < z) ++plane;
    return plane;
  }

 private:
  std::span<const std::int64_t> planes_;
  std::uint32_t shift_ = 0;
  Buffer<std::uint32_t> place_;
};

}  // namespace

PlaneIndex index_crossings(std::span<const Triangle> triangles, std::span<const std::int64_t> planes) {
  const PlaneFinder first_at_or_above(planes);
  return {0, static_cast<std::int64_t>(planes.size()) - 1, 0, [&](auto use) {
            for (std::uint32_t facet = 0; facet < triangles.size(); ++facet) {
              const Triangle& t = triangles[facet];
              const auto [low, high] = std::minmax({t.a.z, t.b.z, t.c.z});
              const std::uint32_t first = first_at_or_above(low), last = first_at_or_above(high);
              if (first < last) use({first, last, facet});
            }
          }};
}

}  // namespace lamina::slice
