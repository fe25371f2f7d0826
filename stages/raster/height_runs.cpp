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
      groups_(ceil_div(bounds.size(), std::size_t{kLanes})),
      tops_(runs_.size()) {
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
  Group& top = tops_[run];
  top.clear();
  for (std::size_t begin = 0; begin < size; begin += kLanes) {
    Group& group = groups_[(first + begin) / kLanes];
    group.clear();
    for (std::size_t lane = 0; lane < std::min<std::size_t>(kLanes, size - begin); ++lane) {
      const Box& one = bounds[first + begin + lane];
      if (one.height() == 0) continue;
      group.z_begin[lane] = step_of(std::int64_t{one.lo.z} - box.lo.z, z_shift);
      group.z_last[lane] = step_of(std::int64_t{one.hi.z} - 1 - box.lo.z, z_shift);
      group.y_begin[lane] = step_of(std::int64_t{one.lo.y} - box.lo.y, y_shift);
      group.y_last[lane] = step_of(std::int64_t{one.hi.y} - box.lo.y, y_shift);
    }
    top.join(begin / kLanes, group);
  }
}

void HeightRuns::Group::clear() {
  std::ranges::fill(z_begin, UINT16_MAX);
  std::ranges::fill(y_begin, UINT16_MAX);
  std::ranges::fill(z_last, std::uint16_t{0});
  std::ranges::fill(y_last, std::uint16_t{0});
}

void HeightRuns::Group::join(std::size_t lane, const Group& group) {
  z_begin[lane] = std::ranges::min(group.z_begin);
  z_last[lane] = std::ranges::max(group.z_last);
  y_begin[lane] = std::ranges::min(group.y_begin);
  y_last[lane] = std::ranges::max(group.y_last);
}

inline std::uint32_t HeightRuns::lanes_met(const Group& group, const Search& search) {
#if defined(__SSE2__)
  // Differences of unsigned numbers that stop at zero: a <= b exactly if a - b does.
  const auto all = [](std::uint16_t value) { return _mm_set1_epi16(static_cast<short>(value)); };
  const auto eight = [](const std::uint16_t* row, int half) {
    return _mm_load_si128(reinterpret_cast<const __m128i*>(row) + half);
  };
  const auto neighbour = [&](const std::uint16_t* begin, const std::uint16_t* last, __m128i low, __m128i high, int half) {
    return _mm_or_si128(_mm_subs_epu16(eight(begin, half), high), _mm_subs_epu16(low, eight(last, half)));
  };
  const __m128i z = all(search.z);
  __m128i gap[2] = {neighbour(group.z_begin, group.z_last, z, z, 0), neighbour(group.z_begin, group.z_last, z, z, 1)};
  if (!search.all_rows) {
    const __m128i low = all(search.y_low), high = all(search.y_high);
    for (int half = 0; half < 2; ++half) {
      gap[half] = _mm_or_si128(gap[half], neighbour(group.y_begin, group.y_last, low, high, half));
    }
  }
  const __m128i none = _mm_setzero_si128();
  const __m128i met = _mm_packs_epi16(_mm_cmpeq_epi16(gap[0], none), _mm_cmpeq_epi16(gap[1], none));
  return static_cast<std::uint32_t>(_mm_movemask_epi8(met));
#else
  std::uint32_t lanes = 0;
  for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
    const bool met = group.z_begin[lane] <= search.z && search.z <= group.z_last[lane] &&
                     (search.all_rows || (group.y_begin[lane] <= search.y_high && search.y_low <= group.y_last[lane]));
    lanes |= static_cast<std::uint32_t>(met) << lane;
  }
  return lanes;
#endif
}

void HeightRuns::find_clusters(std::uint32_t run, std::int64_t plane, std::int64_t low, std::int64_t high,
                               std::uint32_t instance, ClusterVisits& out) const {
  const Box& box = runs_[run];
  if (plane < box.lo.z || plane >= box.hi.z || high < box.lo.y || low > box.hi.y) return;
  const std::uint32_t y_shift = shift_for(box.depth());
  const Search search{step_of(plane - box.lo.z, shift_for(box.height())),
                      step_of(std::max<std::int64_t>(0, low - box.lo.y), y_shift),
                      step_of(std::min(box.depth(), high - box.lo.y), y_shift), low <= box.lo.y && high >= box.hi.y};
  const std::uint32_t first = run * (kRun / kLanes), met = lanes_met(tops_[run], search);
  for (std::uint32_t groups = met; groups != 0; groups &= groups - 1) {  // no cache holds the tables of a large mesh
    const auto* const group =
        reinterpret_cast<const char*>(&groups_[first + static_cast<std::uint32_t>(std::countr_zero(groups))]);
    __builtin_prefetch(group);
    __builtin_prefetch(group + sizeof(Group) / 2);
  }
  for (std::uint32_t groups = met; groups != 0; groups &= groups - 1) {
    const std::uint32_t number = first + static_cast<std::uint32_t>(std::countr_zero(groups));
    const Group& group = groups_[number];
    for (std::uint32_t lanes = lanes_met(group, search); lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
      const std::uint32_t cluster = number * kLanes + lane;
      const bool ends_here = group.z_begin[lane] == search.z || group.z_last[lane] == search.z;
      if (ends_here && (bounds_[cluster].lo.z > plane || bounds_[cluster].hi.z <= plane)) continue;
      out.push_back({cluster, instance});
    }
  }
}

}  // namespace lamina::raster
