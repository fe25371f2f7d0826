#include "stages/slice/plane_index.h"

#include <bit>
#include <utility>

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

std::uint32_t level_of(std::uint32_t planes_crossed) { return static_cast<std::uint32_t>(std::bit_width(planes_crossed - 1)); }

}  // namespace

PlaneIndex::PlaneIndex(std::span<const Triangle> triangles, std::span<const std::int64_t> planes) {
  const PlaneFinder first_at_or_above(planes);
  std::vector<Level> levels(33);
  const auto for_each_crossing = [&](auto&& act) {
    for (std::uint32_t facet = 0; facet < triangles.size(); ++facet) {
      const Triangle& t = triangles[facet];
      const auto [low, high] = std::minmax({t.a.z, t.b.z, t.c.z});
      const std::uint32_t first = first_at_or_above(low), last = first_at_or_above(high);
      if (first < last) act(Entry{first, last, facet});
    }
  };
  for_each_crossing([&](const Entry& entry) {
    Level& level = levels[level_of(entry.last - entry.first)];
    if (level.offset.empty()) {
      level.shift = level_of(entry.last - entry.first);
      level.offset.assign((planes.size() >> level.shift) + 2, 0);
    }
    ++level.offset[entry.first >> level.shift];
  });
  for (Level& level : levels) {
    std::uint32_t total = 0;
    for (std::uint32_t& offset : level.offset) total += std::exchange(offset, total);
    level.entry.resize(total);
  }
  for_each_crossing([&](const Entry& entry) {
    Level& level = levels[level_of(entry.last - entry.first)];
    level.entry[level.offset[entry.first >> level.shift]++] = entry;
  });
  for (Level& level : levels) {
    if (level.entry.empty()) continue;
    std::copy_backward(level.offset.begin(), level.offset.end() - 1, level.offset.end());
    level.offset.front() = 0;
    levels_.push_back(std::move(level));
  }
}

void PlaneIndex::find(std::uint32_t plane, Buffer<std::uint32_t>& facets) const {
  for (const Level& level : levels_) {
    const std::uint32_t own = plane >> level.shift;
    if (level.shift == 0) {
      for (std::uint32_t i = level.offset[own]; i < level.offset[own + 1]; ++i) facets.push_back(level.entry[i].facet);
      continue;
    }
    const std::uint32_t begin = level.offset[own == 0 ? 0 : own - 1], end = level.offset[own + 1];
    const std::size_t before = facets.size();
    facets.resize(before + (end - begin));
    std::uint32_t* out = facets.data() + before;
    for (std::uint32_t i = begin; i < end; ++i) {
      const Entry& entry = level.entry[i];
      *out = entry.facet;
      out += entry.first <= plane && plane < entry.last ? 1 : 0;
    }
    facets.resize(static_cast<std::size_t>(out - facets.data()));
  }
}

std::uint64_t PlaneIndex::most_facets(std::uint32_t plane) const {
  std::uint64_t most = 0;
  for (const Level& level : levels_) {
    const std::uint32_t own = plane >> level.shift;
    most += level.offset[own + 1] - level.offset[own == 0 || level.shift == 0 ? own : own - 1];
  }
  return most;
}

std::uint64_t PlaneIndex::bytes() const {
  std::uint64_t total = 0;
  for (const Level& level : levels_) total += bytes_held(level.offset) + bytes_held(level.entry);
  return total;
}

}  // namespace lamina::slice
