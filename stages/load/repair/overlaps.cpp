// stages/load/repair/overlaps.cpp: a sweep along x.
#include "stages/load/repair/overlaps.h"

#include <algorithm>
#include <vector>

namespace lamina::load {

bool for_each_overlap(std::span<const Box> boxes, const std::function<bool(std::uint32_t, std::uint32_t)>& visit) {
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < boxes.size(); ++i)
    if (!boxes[i].empty()) order.push_back(i);
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return std::pair(boxes[i].lo.x, i); });
  std::uint64_t left = std::uint64_t{1} << 26;
  for (auto one = order.begin(); one != order.end(); ++one) {
    const Box& a = boxes[*one];
    for (auto other = one + 1; other != order.end() && boxes[*other].lo.x < a.hi.x; ++other) {
      if (left-- == 0) return false;
      const Box& b = boxes[*other];
      if (a.lo.y >= b.hi.y || b.lo.y >= a.hi.y || a.lo.z >= b.hi.z || b.lo.z >= a.hi.z) continue;
      if (!visit(*one, *other)) return true;
    }
  }
  return true;
}

}  // namespace lamina::load
