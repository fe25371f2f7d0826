// stages/geometry/interval_table.h: which of many intervals contain a number.
//
// An interval is stored at the level whose buckets are as long as the interval or up to twice that, and there in the bucket of
// its lower end. A number meets only intervals of its own bucket and of the one below, on each level. Each interval is stored
// once, however long it is; memory does not depend on the number of queries, and any thread can query at any time.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina {

/// T  an integer of 32 bits
template <class T>
class IntervalTable {
 public:
  struct Entry {
    T low, high;  // [low, high)
    std::uint32_t id;
  };

  /// lowest, highest  of all lower ends; a table without entries may have any
  /// finest           buckets are at least 2^finest long; 0 only if no interval is empty
  /// for_each         for_each(use) calls use(Entry) for every interval, the same ones in the same order each time
  /// cost             count, scan, fill: O(n); 12 bytes an interval, and 4 for each bucket of a level that stores something
  template <class ForEach>
  IntervalTable(std::int64_t lowest, std::int64_t highest, std::uint32_t finest, ForEach for_each) {
    std::array<Level, 33> levels;
    const auto level_of = [&](const Entry& entry) -> Level& {
      const auto length = static_cast<std::uint64_t>(std::int64_t{entry.high} - std::int64_t{entry.low});
      return levels[std::max(finest, static_cast<std::uint32_t>(std::bit_width(length - (length > 0 ? 1 : 0))))];
    };
    for (std::uint32_t shift = 0; shift < levels.size(); ++shift) levels[shift] = {shift, lowest >> shift, {}, {}};
    for_each([&](const Entry& entry) {
      Level& level = level_of(entry);
      if (level.offset.empty()) level.offset.assign(static_cast<std::size_t>((highest >> level.shift) - level.first) + 2, 0);
      ++level.offset[level.bucket_of(entry.low)];
    });
    for (Level& level : levels) {
      std::uint32_t total = 0;
      for (std::uint32_t& offset : level.offset) total += std::exchange(offset, total);
      level.entry.resize(total);
    }
    // Each offset moves to the end of its bucket while it is filled, which is where the next one begins.
    for_each([&](const Entry& entry) {
      Level& level = level_of(entry);
      level.entry[level.offset[level.bucket_of(entry.low)]++] = entry;
    });
    for (Level& level : levels) {
      if (level.entry.empty()) continue;
      std::copy_backward(level.offset.begin(), level.offset.end() - 1, level.offset.end());
      level.offset.front() = 0;
      levels_.push_back(std::move(level));
    }
  }

  /// Calls use(id) for every interval that begins at or below `last` and ends above `first`; each once, always in the same
  /// order. first <= last
  template <class Use>
  void find(std::int64_t first, std::int64_t last, Use use) const {
    for (const Level& level : levels_) {
      for (const Entry& entry : level.near(first, last)) {
        if (entry.low <= last && entry.high > first) use(entry.id);
      }
    }
  }

  /// Appends the ids of the intervals that contain a number, in the order of find().
  void append(std::int64_t number, Buffer<std::uint32_t>& ids) const {
    for (const Level& level : levels_) {
      const std::span<const Entry> near = level.near(number, number);
      const std::size_t before = ids.size();
      ids.resize(before + near.size());
      std::uint32_t* out = ids.data() + before;
      if (level.shift == 0) {  // intervals of length 1, in their own bucket
        for (const Entry& entry : near) *out++ = entry.id;
        continue;
      }
      for (const Entry& entry : near) {
        *out = entry.id;
        out += entry.low <= number && number < entry.high ? 1 : 0;
      }
      ids.resize(static_cast<std::size_t>(out - ids.data()));
    }
  }

  /// append() appends no more than this.
  std::uint64_t max_found(std::int64_t number) const {
    std::uint64_t maximum = 0;
    for (const Level& level : levels_) maximum += level.near(number, number).size();
    return maximum;
  }

  std::uint64_t bytes() const {
    std::uint64_t total = 0;
    for (const Level& level : levels_) total += bytes_held(level.offset) + bytes_held(level.entry);
    return total;
  }

 private:
  struct Level {
    std::uint32_t shift = 0;       // a bucket is 2^shift long
    std::int64_t first = 0;        // number of the lowest bucket
    Buffer<std::uint32_t> offset;  // buckets + 1
    Buffer<Entry> entry;

    std::size_t bucket_of(T low) const { return static_cast<std::size_t>((std::int64_t{low} >> shift) - first); }
    /// Those that may reach a number of first .. last.
    std::span<const Entry> near(std::int64_t first_number, std::int64_t last_number) const {
      const std::int64_t buckets = static_cast<std::int64_t>(offset.size()) - 1, below = shift == 0 ? 0 : 1;
      const std::int64_t begin = std::clamp<std::int64_t>((first_number >> shift) - first - below, 0, buckets);
      const std::int64_t end = std::clamp<std::int64_t>((last_number >> shift) - first + 1, 0, buckets);
      const std::uint32_t from = offset[static_cast<std::size_t>(begin)];
      return {entry.data() + from, offset[static_cast<std::size_t>(end)] - from};
    }
  };
  std::vector<Level> levels_;  // only those that store something
};

/// Boxes by height, nm; ids are their numbers. A number z meets those with lo.z <= z < hi.z, and find() between two heights
/// also flat ones.
inline IntervalTable<Nm> heights_of(std::span<const Box> boxes) {
  constexpr std::uint32_t kFinest = 14;  // 16 micrometres: below most layers, and few buckets for a tall part
  std::int64_t lowest = INT64_MAX, highest = INT64_MIN;
  for (const Box& box : boxes) {
    if (box.empty()) continue;
    lowest = std::min<std::int64_t>(lowest, box.lo.z);
    highest = std::max<std::int64_t>(highest, box.lo.z);
  }
  return {lowest, highest, kFinest, [&](auto use) {
            for (std::uint32_t i = 0; i < boxes.size(); ++i) {
              if (!boxes[i].empty()) use({boxes[i].lo.z, boxes[i].hi.z, i});
            }
          }};
}

}  // namespace lamina
