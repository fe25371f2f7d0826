#include "stages/slice/bodies.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace lamina::slice {

Box grown(Box box, Nm by) {
  if (box.empty()) return box;
  box.lo.x -= by, box.lo.y -= by, box.hi.x += by, box.hi.y += by;
  return box;
}

bool touch(const Box& a, const Box& b) {
  return !a.empty() && !b.empty() && a.lo.x <= b.hi.x && b.lo.x <= a.hi.x && a.lo.y <= b.hi.y && b.lo.y <= a.hi.y &&
         a.lo.z <= b.hi.z && b.lo.z <= a.hi.z;
}

std::vector<std::uint32_t> group_bodies(std::span<const Box> boxes) {
  const auto count = static_cast<std::uint32_t>(boxes.size());
  std::vector<std::uint32_t> root(count), order(count);
  std::iota(root.begin(), root.end(), 0u);
  std::iota(order.begin(), order.end(), 0u);
  const auto find = [&](std::uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return std::pair(boxes[i].lo.x, i); });
  std::vector<std::uint32_t> open;
  for (const std::uint32_t i : order) {
    std::erase_if(open, [&](std::uint32_t other) { return boxes[other].hi.x < boxes[i].lo.x; });
    for (const std::uint32_t other : open) {
      if (!touch(boxes[i], boxes[other])) continue;
      const std::uint32_t a = find(i), b = find(other);
      root[std::max(a, b)] = std::min(a, b);
    }
    open.push_back(i);
  }
  std::vector<std::uint32_t> body(count), number(count, UINT32_MAX);
  std::uint32_t bodies = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    std::uint32_t& own = number[find(i)];
    if (own == UINT32_MAX) own = bodies++;
    body[i] = own;
  }
  return body;
}

std::vector<std::uint32_t> group_from_above(std::vector<Box> boxes) {
  for (Box& box : boxes) box.lo.z = box.hi.z = 0;
  std::vector<std::uint32_t> group(boxes.size());
  for (std::uint32_t i = 0; i < group.size(); ++i) group[i] = i;
  for (std::size_t count = boxes.size() + 1; boxes.size() < count;) {
    count = boxes.size();
    const std::vector<std::uint32_t> next = group_bodies(boxes);
    std::vector<Box> around(next.empty() ? 0 : *std::ranges::max_element(next) + 1);
    for (std::size_t i = 0; i < next.size(); ++i) around[next[i]].add(boxes[i]);
    for (std::uint32_t& of : group) of = next[of];
    boxes = std::move(around);
  }
  return group;
}

}  // namespace lamina::slice
