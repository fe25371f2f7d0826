#include "stages/slice/deep.h"

#include <utility>

#include "stages/geometry/boxes.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/simplify.h"

namespace lamina::slice {

bool overlaps_deeply(std::span<const Box> boxes) {
  if (boxes.size() <= kDeep) return false;
  std::uint64_t left = kDeep * boxes.size();
  for_each_overlap(boxes, [&](auto, auto) { return --left > 0; });
  return left == 0;
}

Result<Contours> combine_pairwise(std::vector<Contours> sets, FillRule rule, std::uint64_t* points) {
  // Sets wind once about what is solid and never about the rest.
  const FillRule of_pair = rule == FillRule::kEvenOdd ? rule : FillRule::kNonzero;
  for (; sets.size() > 1; sets.resize((sets.size() + 1) / 2)) {
    for (std::size_t i = 0; i + 1 < sets.size(); i += 2) {
      Contours &one = sets[i], &other = sets[i + 1];
      if (one.point == other.point && one.offset == other.offset) {
        if (rule == FillRule::kEvenOdd) one.clear();
      } else if (one.size() == 0) {
        one = std::move(other);
      } else if (other.size() > 0) {
        one.append(other);
        if (points != nullptr) *points += one.point.size();
        auto both = contour_union(one, of_pair, false);
        if (!both) return both.error();
        one = std::move(*both);
        tidy(one);
      }
      other = {};
      if (i > 0) sets[i / 2] = std::exchange(one, {});
    }
    if (sets.size() % 2 == 1) sets[sets.size() / 2] = std::exchange(sets.back(), {});
  }
  return sets.empty() ? Contours() : std::move(sets.front());
}

}  // namespace lamina::slice
