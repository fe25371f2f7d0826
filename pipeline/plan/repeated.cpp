#include "pipeline/plan/repeated.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <tuple>

#include "pipeline/plan/sections.h"
#include "stages/geometry/boxes.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

void drop_repeated(FillRule rule, Scene& scene) {
  const auto count = static_cast<std::uint32_t>(scene.instances.size());
  const auto key = [&](std::uint32_t i) {
    const auto& [mesh, at] = scene.instances[i];
    return std::tuple(scene.part_of_instance[i], mesh, at.x, at.y, at.z, i);
  };
  const auto alike = [&](std::uint32_t i, std::uint32_t j) {
    const Point3 &at = scene.instances[i].offset, &other = scene.instances[j].offset;
    return scene.part_of_instance[i] == scene.part_of_instance[j] && scene.instances[i].mesh == scene.instances[j].mesh &&
           at.x == other.x && at.y == other.y && at.z == other.z;
  };
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::sort(order, {}, key);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> repeated;  // [begin, end) of order
  for (std::uint32_t begin = 0, end = 0; begin < count; begin = end) {
    while (end < count && alike(order[begin], order[end])) ++end;
    repeated.emplace_back(begin, end);
  }
  if (repeated.size() == count) return;
  std::vector<Box> boxes;
  for (const auto& [begin, end] : repeated) boxes.push_back(box_of(scene, scene.instances[order[begin]]));
  const std::vector<std::uint32_t> body = group_touching(boxes);
  std::vector<std::uint32_t> divisor(repeated.size(), 0);
  for (std::size_t r = 0; r < repeated.size(); ++r)
    divisor[body[r]] = std::gcd(divisor[body[r]], repeated[r].second - repeated[r].first);
  std::vector<std::uint8_t> dropped(count, 0);
  std::vector<std::uint32_t> of_part(scene.parts.size(), 0);
  for (std::size_t r = 0; r < repeated.size(); ++r) {
    const auto [begin, end] = repeated[r];
    const std::uint32_t all = end - begin;
    const std::uint32_t kept = rule == FillRule::kEvenOdd ? 2 - all % 2 : all / divisor[body[r]];
    for (std::uint32_t i = begin + kept; i < end; ++i) dropped[order[i]] = 1;
    of_part[scene.part_of_instance[order[begin]]] += all - std::min(all, kept);
  }
  std::uint32_t left = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (dropped[i] != 0) continue;
    scene.instances[left] = scene.instances[i];
    scene.part_of_instance[left++] = scene.part_of_instance[i];
  }
  scene.instances.resize(left);
  scene.part_of_instance.resize(left);
  for (std::size_t p = 0; p < of_part.size(); ++p) {
    if (of_part[p] == 0) continue;
    scene.parts[p].notes.push_back(
        {false,
         fmt::format("{} of its objects {} exactly where another one of the same mesh is, and {} left out: no pixel changes",
                     readable_count(of_part[p]), of_part[p] == 1 ? "is" : "are", of_part[p] == 1 ? "is" : "are")});
  }
}

}  // namespace lamina::pipeline
