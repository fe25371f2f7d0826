#include "stages/raster/height_runs.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <bit>

namespace lamina::raster {
namespace {

/// Bits by which a length is shifted to fit into 16.
std::uint32_t shift_for(std::int64_t length) {
  return static_cast<std::uint32_t>(std::max(16, static_cast<int>(std::bit_width(static_cast<std::uint64_t>(length))))) - 16;
}

std::uint16_t step_of(std::int64_t distance, std::uint32_t shift) { return static_cast<std::uint16_t>(distance >> shift); }

}  // namespace

HeightRuns::HeightRuns(std::span<const Box> bounds)
    : bounds_(bounds),
      runs_(ceil_div(bounds.size(), std::size_t{kRun})),
      groups_(ceil_div(bounds.size(), std::size_t{kLanes})) {
  constexpr std::uint32_t kAtOnce = 16;
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, count(), kAtOnce),
                    [&](const tbb::blocked_range<std::uint32_t>& range) {
                      for (std::uint32_t run = range.begin(); run != range.end(); ++run) build_run(bounds, run);
                    });
}

void HeightRuns::build_run(std::span<const Box> bounds, std::uint32_t run) {
  const std::size_t first = std::size_t{run} * kRun, size = std::min<std::size_t>(kRun, bounds.size() - first);
  Box box;
  for (const Box& one : bounds.subspan(first, size)) box.add(one);
  runs_[run] = box;
  const std::uint32_t z_shift = shift_for(box.height()), y_shift = shift_for(box.depth());
  for (std::size_t i = 0; i < ceil_div(size, std::size_t{kLanes}) * kLanes; ++i) {
    Group& group = groups_[(first + i) / kLanes];
    const std::size_t lane = i % kLanes;
    group.z_begin[lane] = group.y_begin[lane] = UINT16_MAX;
    group.z_last[lane] = group.y_last[lane] = 0;
    if (i >= size || bounds[first + i].height() == 0) continue;
    const Box& one = bounds[first + i];
    group.z_begin[lane] = step_of(std::int64_t{one.lo.z} - box.lo.z, z_shift);
    group.z_last[lane] = step_of(std::int64_t{one.hi.z} - 1 - box.lo.z, z_shift);
    group.y_begin[lane] = step_of(std::int64_t{one.lo.y} - box.lo.y, y_shift);
    group.y_last[lane] = step_of(std::int64_t{one.hi.y} - box.lo.y, y_shift);
  }
}

std::uint32_t HeightRuns::lanes_met(const Group& group, std::uint16_t z, std::uint16_t y_low, std::uint16_t y_high) {
#if defined(__SSE2__)
  // Differences of unsigned numbers that stop at zero: a <= b exactly if a - b does.
  const auto all = [](std::uint16_t value) { return _mm_set1_epi16(static_cast<short>(value)); };
  const auto eight = [](const std::uint16_t* row, int half) {
    return _mm_load_si128(reinterpret_cast<const __m128i*>(row) + half);
  };
  const __m128i plane = all(z), low = all(y_low), high = all(y_high);
  __m128i met[2];
  for (int half = 0; half < 2; ++half) {
    const __m128i beside_z =
        _mm_or_si128(_mm_subs_epu16(eight(group.z_begin, half), plane), _mm_subs_epu16(plane, eight(group.z_last, half)));
    const __m128i beside_y =
        _mm_or_si128(_mm_subs_epu16(eight(group.y_begin, half), high), _mm_subs_epu16(low, eight(group.y_last, half)));
    met[half] = _mm_cmpeq_epi16(_mm_or_si128(beside_z, beside_y), _mm_setzero_si128());
  }
  return static_cast<std::uint32_t>(_mm_movemask_epi8(_mm_packs_epi16(met[0], met[1])));
#else
  std::uint32_t lanes = 0;
  for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
    const bool met =
        group.z_begin[lane] <= z && z <= group.z_last[lane] && group.y_begin[lane] <= y_high && y_low <= group.y_last[lane];
    lanes |= static_cast<std::uint32_t>(met) << lane;
  }
  return lanes;
#endif
}

void HeightRuns::find_clusters(std::uint32_t run, std::int64_t plane, std::int64_t low, std::int64_t high,
                               std::uint32_t instance, ClusterVisits& out) const {
  const Box& box = runs_[run];
  if (plane < box.lo.z || plane >= box.hi.z || high < box.lo.y || low > box.hi.y) return;
  const std::uint16_t z = step_of(plane - box.lo.z, shift_for(box.height()));
  const std::uint32_t y_shift = shift_for(box.depth());
  const std::uint16_t y_low = step_of(std::max<std::int64_t>(0, low - box.lo.y), y_shift);
  const std::uint16_t y_high = step_of(std::min(box.depth(), high - box.lo.y), y_shift);
  const std::uint32_t first = run * (kRun / kLanes);
  const auto last = static_cast<std::uint32_t>(std::min<std::size_t>(first + kRun / kLanes, groups_.size()));
  for (std::uint32_t group = first; group < last; ++group) {
    for (std::uint32_t lanes = lanes_met(groups_[group], z, y_low, y_high); lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
      const std::uint32_t cluster = group * kLanes + lane;
      const bool ends_here = groups_[group].z_begin[lane] == z || groups_[group].z_last[lane] == z;
      if (ends_here && (bounds_[cluster].lo.z > plane || bounds_[cluster].hi.z <= plane)) continue;
      out.push_back({cluster, instance});
    }
  }
}

}  // namespace lamina::raster
