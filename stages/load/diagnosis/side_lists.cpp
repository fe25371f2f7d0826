#include "stages/load/diagnosis/side_lists.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
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

namespace {

/// The corners of a facet, rising, and whether it names them in that order, or a rotation of it, or has no orientation.
std::array<std::uint32_t, 4> key_of(const Numbered& mesh, std::uint32_t f) {
  auto [a, b, c] = mesh.facet(f);
  bool forward = true;
  if (a > b) std::swap(a, b), forward = !forward;
  if (b > c) std::swap(b, c), forward = !forward;
  if (a > b) std::swap(a, b), forward = !forward;
  return {a, b, c, forward || mesh.collapsed(f)};
}

}  // namespace

std::vector<std::uint32_t> repeats_among(const Numbered& mesh, std::vector<std::uint32_t>& facets) {
  std::sort(facets.begin(), facets.end(), [&](auto one, auto other) { return mesh.listed(one) < mesh.listed(other); });
  facets.erase(std::unique(facets.begin(), facets.end()), facets.end());
  std::stable_sort(facets.begin(), facets.end(), [&](auto one, auto other) { return key_of(mesh, one) < key_of(mesh, other); });
  std::vector<std::uint32_t> repeats;
  for (std::size_t i = 1; i < facets.size(); ++i)
    if (key_of(mesh, facets[i]) == key_of(mesh, facets[i - 1])) repeats.push_back(facets[i]);
  return repeats;
}

}  // namespace lamina::load
