// Corners find the first corner that is the same vertex through a table in which the first corner of each hash stands: it is
// written from the last corner to the first, so nothing asks what it held. Vertices whose slot another one has are few; they
// are matched the same way among themselves, and those that are left then by probing.
#include "stages/geometry/blocks/vertex_numbers.h"

namespace lamina {

bool VertexNumbers::number(const SortedBlock& block, const BlockKernels& kernels) {
  const std::uint32_t corners = block.clusters() * SortedBlock::kCorners, most = block.triangles * 3 / 2;
  // A fixed number of corners a round, so that compilers unroll it.
  constexpr std::uint32_t kRound = 16;
  static_assert(SortedBlock::kCorners % kRound == 0);
  for (std::uint32_t end = corners; end > 0; end -= kRound) {
    const std::uint16_t* const hash = block.hash.data() + end;
    for (std::uint32_t i = 1; i <= kRound; ++i) {
      matches_.slot[*(hash - i) % CornerMatches::kSlots] = static_cast<std::uint16_t>(end - i);
    }
  }
  kernels.match(block, matches_);
  if (matches_.found > most) return false;
  if (matches_.unmatched > 0) match_again(block);
  if (matches_.unmatched > 0) match_rest(block);
  count_ = kernels.number(corners, matches_);
  return count_ <= most;
}

/// The same once more among those that are left: nearly all of their slots had two vertices, one of which is matched. Whether
/// one matches is not foreseen, so nothing branches on it.
void VertexNumbers::match_again(const SortedBlock& block) {
  auto& [slot, first, rest, number, vertex, found, unmatched] = matches_;
  for (std::uint32_t r = unmatched; r-- > 0;) slot[block.hash[rest[r]] % CornerMatches::kSlots] = rest[r];
  std::uint32_t left = 0;
  for (std::uint32_t r = 0; r < unmatched; ++r) {
    const std::uint16_t i = rest[r], candidate = slot[block.hash[i] % CornerMatches::kSlots];
    first[i] = candidate;
    rest[left] = i;
    left += difference(corner_at(block, i), corner_at(block, candidate)) != 0 ? 1 : 0;
  }
  unmatched = left;
}

/// By open addressing. Hashes decide only where the search begins.
void VertexNumbers::match_rest(const SortedBlock& block) {
  constexpr std::uint16_t kNone = UINT16_MAX;
  auto& slot = matches_.slot;
  slot.fill(kNone);
  for (std::uint32_t r = 0; r < matches_.unmatched; ++r) {
    const std::uint16_t i = matches_.rest[r];
    const Nm* const corner = corner_at(block, i);
    std::uint32_t at = block.hash[i] % CornerMatches::kSlots;
    while (slot[at] != kNone && difference(corner, corner_at(block, slot[at])) != 0) at = (at + 1) % CornerMatches::kSlots;
    if (slot[at] == kNone) slot[at] = i;
    matches_.first[i] = slot[at];
  }
}

}  // namespace lamina
