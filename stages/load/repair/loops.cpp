// stages/load/repair/loops.cpp: a walk with a stack, after Hierholzer (1873), cut at every vertex that comes again.
#include "stages/load/repair/loops.h"

#include <algorithm>
#include <utility>

namespace lamina::load {

void for_each_loop(std::span<const Side> sides, const std::function<void(std::span<const std::uint32_t>)>& cap) {
  Buffer<std::pair<std::uint32_t, std::uint32_t>> edges;  // as caps walk them
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    for (std::int64_t left = surplus(begin, end); left != 0; left -= left > 0 ? 1 : -1)
      edges.push_back(left > 0 ? std::pair{begin->high, begin->low} : std::pair{begin->low, begin->high});
  });
  std::sort(edges.begin(), edges.end());

  // Vertices as positions in a short list, each with the range of its edges that are still to be walked.
  Buffer<std::uint32_t> vertices, next, end;
  for (std::uint32_t i = 0; i < edges.size(); ++i) {
    if (i == 0 || edges[i].first != edges[i - 1].first) {
      vertices.push_back(edges[i].first);
      next.push_back(i);
      end.push_back(i);
    }
    ++end.back();
  }
  const auto position = [&](std::uint32_t vertex) {
    return static_cast<std::uint32_t>(std::lower_bound(vertices.begin(), vertices.end(), vertex) - vertices.begin());
  };
  Buffer<std::uint8_t> on_stack(vertices.size());
  std::fill(on_stack.begin(), on_stack.end(), std::uint8_t{0});
  Buffer<std::uint32_t> stack, loop;
  for (std::uint32_t start = 0; start < vertices.size(); ++start) {
    while (next[start] != end[start] || !stack.empty()) {
      if (stack.empty()) {
        stack.push_back(start);
        on_stack[start] = 1;
      }
      const std::uint32_t at = stack.back();
      if (next[at] == end[at]) {  // only the start can be left without edges, when its loops are done
        stack.clear();
        on_stack[at] = 0;
        break;
      }
      const std::uint32_t to = position(edges[next[at]++].second);
      if (!on_stack[to]) {
        on_stack[to] = 1;
        stack.push_back(to);
        continue;
      }
      loop.clear();
      while (true) {
        const std::uint32_t back = stack.back();
        loop.push_back(vertices[back]);
        if (back == to) break;
        on_stack[back] = 0;
        stack.pop_back();
      }
      std::reverse(loop.begin(), loop.end());
      std::rotate(loop.begin(), std::min_element(loop.begin(), loop.end()), loop.end());
      cap(loop);
    }
  }
}

}  // namespace lamina::load
