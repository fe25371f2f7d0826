#include "stages/slice/chain.h"

#include <bit>

namespace lamina::slice {
namespace {

constexpr std::uint32_t kNone = UINT32_MAX;
constexpr std::uint32_t kTaken = UINT32_MAX;  // of a slot: passed over, but the search goes on behind it
constexpr std::uint8_t kHasPrevious = 1, kVisited = 2;

/// For each cut the one that starts at the edge where it ends. Where several start there, at an edge of four or more
/// facets, the first that is free.
void find_successors(const Cuts& cuts, ChainScratch& scratch) {
  const std::size_t count = cuts.size();
  const std::size_t slots = std::bit_ceil(2 * count + 2);
  const std::size_t mask = slots - 1;
  scratch.slot.assign(slots, 0);
  scratch.next.resize(count);
  scratch.state.assign(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    std::size_t position = cuts.from_hash[i] & mask;
    while (scratch.slot[position] != 0) position = (position + 1) & mask;
    scratch.slot[position] = static_cast<std::uint32_t>(i + 1);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t hash = cuts.to_hash[i];
    std::uint32_t found = kNone;
    for (std::size_t position = hash & mask; scratch.slot[position] != 0; position = (position + 1) & mask) {
      if (scratch.slot[position] == kTaken) continue;
      const std::uint32_t other = scratch.slot[position] - 1;
      if (cuts.from_hash[other] != hash || !(cuts.from[other] == cuts.to[i])) continue;
      scratch.slot[position] = kTaken;
      scratch.state[other] |= kHasPrevious;
      found = other;
      break;
    }
    scratch.next[i] = found;
  }
}

}  // namespace

void chain(const Cuts& cuts, std::int64_t z, ChainScratch& scratch, Contours& closed, Contours& open) {
  find_successors(cuts, scratch);
  const auto count = static_cast<std::uint32_t>(cuts.size());
  for (std::uint32_t first = 0; first < count; ++first) {
    if ((scratch.state[first] & kHasPrevious) != 0) continue;
    std::uint32_t last = first;
    for (std::uint32_t i = first; i != kNone; i = scratch.next[i]) {
      open.point.push_back(cuts.at[i]);
      scratch.state[i] |= kVisited;
      last = i;
    }
    open.point.push_back(crossing(cuts.to[last], z));
    open.close();
  }
  for (std::uint32_t first = 0; first < count; ++first) {
    if ((scratch.state[first] & kVisited) != 0) continue;
    std::uint32_t i = first;
    do {
      closed.point.push_back(cuts.at[i]);
      scratch.state[i] |= kVisited;
      i = scratch.next[i];
    } while (i != first);
    closed.close();
  }
}

}  // namespace lamina::slice
