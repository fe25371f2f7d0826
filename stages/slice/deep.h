// stages/slice/deep.h: bodies of instances that overlap many times, such as copies at one position. Their contours are combined
// in small groups: all at once they would meet in as many points as there are pairs of instances.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/contours.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"

namespace lamina::slice {

/// Boxes of a body overlap deeply if they do in more pairs than this for each box on average.
inline constexpr std::uint64_t kDeep = 16;

/// cost  O(N log N + P), for P pairs that overlap in x, and no more than kDeep pairs that overlap for each box
bool overlaps_deeply(std::span<const Box> boxes);

/// Of boolean operations: points that they take, and pairs of sets that they take at once.
struct CombineWork {
  std::uint64_t points = 0, pairs = 0;
};

/// What is solid by the rule of the summed windings of sets of clean contours. Equal sets are not combined. Contours of the
/// result are clean but for corners at which they touch.
/// sets   emptied
/// work   becomes larger by what all boolean operations take
/// errors kInternal of the clipping library
/// cost   O(P log P log N) for N sets whose unions have no more than P points
Result<Contours> combine_in_groups(std::vector<Contours> sets, FillRule rule, CombineWork* work = nullptr);

}  // namespace lamina::slice
