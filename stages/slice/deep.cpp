#include "stages/slice/deep.h"

#include <algorithm>
#include <utility>

#include "stages/geometry/boxes.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/simplify.h"

namespace lamina::slice {

bool overlaps_deeply(std::span<const Box> boxes) {
  if (boxes.size() <= kDeep) return false;
  std::uint64_t left = kDeep * boxes.size() + 1;
  for_each_overlap(boxes, [&](auto, auto) { return --left > 0; });
  return left == 0;
}

namespace {

constexpr std::size_t kTogether = 8;

/// Combines sets into the first of them; equal ones need no combining. all  scratch
Status combine_few(std::span<Contours> sets, FillRule rule, Contours& all, CombineWork& work) {
  std::size_t differing = 0;
  all.clear();
  for (std::size_t i = 0; i < sets.size(); ++i) {
    if (sets[i].size() == 0) continue;
    const auto equal = std::ranges::find_if(
        sets.first(i), [&](const Contours& other) { return other.point == sets[i].point && other.offset == sets[i].offset; });
    if (equal == sets.begin() + static_cast<std::ptrdiff_t>(i)) {
      ++differing;
    } else {
      if (rule == FillRule::kEvenOdd) {
        equal->clear();
        --differing;
      }
      sets[i].clear();
    }
  }
  for (Contours& set : sets) all.append(set);
  if (differing > 1) {
    work.points += all.point.size();
    work.pairs += differing * (differing - 1) / 2;
    auto combined = contour_union(all, rule, false);
    if (!combined) return combined.error();
    all = std::move(*combined);
    tidy(all);
  }
  for (Contours& set : sets) set = {};
  std::swap(sets[0], all);
  return {};
}

}  // namespace

Result<Contours> combine_in_groups(std::vector<Contours> sets, FillRule rule, CombineWork* work) {
  // Sets wind once about what is solid and never about the rest.
  const FillRule of_few = rule == FillRule::kEvenOdd ? rule : FillRule::kNonzero;
  CombineWork counted;
  Contours all;
  while (sets.size() > 1) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < sets.size(); i += kTogether, ++kept) {
      const std::span<Contours> few = std::span(sets).subspan(i, std::min(kTogether, sets.size() - i));
      if (Status status = combine_few(few, of_few, all, counted); !status) return status.error();
      if (i > kept) sets[kept] = std::exchange(sets[i], {});
    }
    sets.resize(kept);
  }
  if (work != nullptr) *work = {work->points + counted.points, work->pairs + counted.pairs};
  return sets.empty() ? Contours() : std::move(sets.front());
}

}  // namespace lamina::slice
