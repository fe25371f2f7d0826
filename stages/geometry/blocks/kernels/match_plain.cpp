#include "stages/geometry/blocks/kernels/kernels.h"

namespace lamina::plain {

// No processor foresees whether a slot is a corner's own, so nothing branches on it.
void match(const SortedBlock& block, CornerMatches& matches) {
  std::uint32_t rest = 0, found = 0;
  for (std::uint32_t c = 0, i = 0; c < block.clusters(); ++c) {
    const Nm* corner = corner_at(block, i);
    for (std::uint32_t k = 0; k < SortedBlock::kCorners; ++k, ++i, ++corner) {
      const std::uint16_t first = matches.slot[block.hash[i] % CornerMatches::kSlots];
      matches.first[i] = first;
      matches.rest[rest] = static_cast<std::uint16_t>(i);
      rest += difference(corner, corner_at(block, first)) != 0 ? 1 : 0;
      found += first == i ? 1 : 0;
    }
  }
  matches.unmatched = rest;
  matches.found = found;
}

std::uint32_t number(std::uint32_t corners, CornerMatches& matches) {
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < corners; ++i) {
    const std::uint16_t first = matches.first[i];
    matches.vertex[count] = static_cast<std::uint16_t>(i);
    matches.number[i] = static_cast<std::uint16_t>(count);
    matches.number[i] = matches.number[first];
    count += first == i ? 1 : 0;
  }
  return count;
}

void write(const SortedBlock& block, const CornerMatches& matches, std::uint32_t count, Point3* to) {
  constexpr std::uint32_t kY = SortedBlock::kCorners, kX = 2 * SortedBlock::kCorners;
  for (std::uint32_t v = 0; v < count; ++v) {
    const Nm* const corner = corner_at(block, matches.vertex[v]);
    to[v] = {corner[kX], corner[kY], corner[0]};
  }
}

}  // namespace lamina::plain
