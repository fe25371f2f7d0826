#include "stages/load/diagnosis/side_lists.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <tuple>

#include "stages/geometry/blocks/pages.h"

namespace lamina::load {
namespace {

/// Longer lists are sorted; shorter ones are put in order by moving what is out of it.
constexpr std::size_t kFew = 24;

bool before(const Side& one, const Side& other) { return std::tie(one.high, one.facet) < std::tie(other.high, other.facet); }

/// Sorts the sides of edges with one lower vertex.
void sort_sides(std::span<Side> sides) {
  if (sides.size() > kFew) return std::sort(sides.begin(), sides.end(), before);
  for (std::size_t i = 1; i < sides.size(); ++i) {
    const Side side = sides[i];
    std::size_t at = i;
    for (; at > 0 && before(side, sides[at - 1]); --at) sides[at] = sides[at - 1];
    sides[at] = side;
  }
}

}  // namespace

SideLists::SideLists(std::uint32_t vertices, std::span<const Buffer<Side>> sides) : begin_(vertices + std::size_t{1}) {
  std::fill(begin_.begin(), begin_.end(), 0u);
  for (const Buffer<Side>& some : sides) {
    for (const Side& side : some) ++begin_[side.low];
  }
  std::uint32_t end = 0;
  for (std::uint32_t& list : begin_) list = end += list;
  sides_.resize(end);
  prefer_large_pages(sides_);
  for (const Buffer<Side>& some : sides) {
    for (const Side& side : some) sides_[--begin_[side.low]] = side;
  }
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, vertices, 1 << 13), [&](const auto& range) {
    for (std::uint32_t v = range.begin(); v != range.end(); ++v) sort_sides({sides_.data() + begin_[v], of(v).size()});
  });
}

}  // namespace lamina::load
