#include "stages/slice/bodies.h"

#include <algorithm>
#include <utility>

#include "stages/geometry/boxes.h"

namespace lamina::slice {

Box grown(Box box, Nm by) {
  if (box.empty()) return box;
  box.lo.x -= by, box.lo.y -= by, box.hi.x += by, box.hi.y += by;
  return box;
}

std::vector<std::uint32_t> group_from_above(std::vector<Box> boxes) {
  for (Box& box : boxes) box.lo.z = box.hi.z = 0;
  std::vector<std::uint32_t> group(boxes.size());
  for (std::uint32_t i = 0; i < group.size(); ++i) group[i] = i;
  for (std::size_t count = boxes.size() + 1; boxes.size() < count;) {
    count = boxes.size();
    const std::vector<std::uint32_t> next = group_touching(boxes);
    std::vector<Box> around(next.empty() ? 0 : *std::ranges::max_element(next) + 1);
    for (std::size_t i = 0; i < next.size(); ++i) around[next[i]].add(boxes[i]);
    for (std::uint32_t& of : group) of = next[of];
    boxes = std::move(around);
  }
  return group;
}

}  // namespace lamina::slice
