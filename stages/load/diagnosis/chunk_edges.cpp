// stages/load/diagnosis/chunk_edges.cpp: sides of one edge meet in a table, as corners of one vertex do (vertices.cpp).
//
// A slot holds the first side of those with its hash. All sides of an edge have one hash: they meet that side, or all of them
// miss it and are left over. So an edge is either found with all of its sides or left with all of them.
#include "stages/load/diagnosis/chunk_edges.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <numeric>
#include <tuple>

#include "stages/geometry/blocks/pages.h"

namespace lamina::load {
namespace {

constexpr int kEndBits = 14;
constexpr std::uint32_t kEndMask = (1u << kEndBits) - 1;
constexpr std::uint32_t kCollapsed = 1u << 31;  // above all keys of edges
static_assert(3 * Numbered::kChunk <= kEndMask + 1 && 2 * kEndBits + 1 < 31);

inline std::uint32_t low_of(std::uint32_t key) { return key >> (kEndBits + 1); }
inline std::uint32_t high_of(std::uint32_t key) { return key >> 1 & kEndMask; }

inline std::uint32_t key_of(std::uint32_t from, std::uint32_t to) {
  return std::min(from, to) << (kEndBits + 1) | std::max(from, to) << 1 | static_cast<std::uint32_t>(from < to);
}

}  // namespace

/// Side k of facet f is side 3 f + k.
void ChunkEdges::take_sides(std::span<const Numbered::Local> facets, std::uint32_t first_facet,
                            Buffer<std::uint32_t>& collapsed) {
  for (std::uint32_t f = 0; f < facets.size(); ++f) {
    const auto& [a, b, c] = facets[f];
    std::uint32_t* const key = key_.data() + 3 * f;
    key[0] = key_of(a, b), key[1] = key_of(b, c), key[2] = key_of(c, a);
    if (a != b && b != c && c != a) [[likely]]
      continue;
    collapsed.push_back(first_facet + f);
    for (std::uint32_t k = 0; k < 3; ++k) {
      key[k] = kCollapsed | (3 * f + k) << 1;  // the same as of no other side
      done_[3 * f + k] = 1;
    }
  }
}

/// Finds pairs among sides, each of which has an end of its own. returns  how many sides have met none, which are in rest_
/// then, each edge with all of its sides
std::uint32_t ChunkEdges::match(std::span<const std::uint16_t> sides, std::uint32_t factor) {
  for (const std::uint16_t i : sides) hash_[i] = static_cast<std::uint16_t>((key_[i] >> 1) * factor >> (32 - kSlotBits));
  for (std::size_t s = sides.size(); s-- > 0;) slot_[hash_[sides[s]]] = sides[s];
  std::uint32_t left = 0, matches = 0;
  for (const std::uint16_t i : sides) {
    const std::uint16_t first = slot_[hash_[i]];
    const bool same = (key_[i] ^ key_[first]) <= 1;
    match_[matches] = {first, i};
    matches += std::uint32_t{same} & std::uint32_t{first != i};
    rest_[left] = i;
    left += !same;
  }
  for (std::uint32_t m = 0; m < matches; ++m) {
    std::uint8_t& others = others_[match_[m][0]];
    others = static_cast<std::uint8_t>(std::min(others + 1, 2));
  }
  for (std::uint32_t m = 0; m < matches; ++m) {
    const auto [one, other] = match_[m];
    const std::uint32_t key = key_[one];
    const std::uint32_t once = others_[one] == 1, both_directions = (key ^ key_[other]) == 1;
    const std::uint32_t found = once & both_directions;
    pair_[pairs_] = {static_cast<std::uint16_t>(one / 3), static_cast<std::uint16_t>(other / 3)};
    pairs_ += found;
    done_[one] |= static_cast<std::uint8_t>(found);
    done_[other] |= static_cast<std::uint8_t>(found);
  }
  return left;
}

std::span<const ChunkEdges::Pair> ChunkEdges::find(const Numbered& mesh, std::size_t chunk, Buffer<Side>& odd,
                                                   Buffer<Side>& rest, Buffer<std::uint32_t>& collapsed) {
  const std::span<const Numbered::Local> facets = mesh.local_facets(chunk);
  const std::span<const std::uint32_t> numbers = mesh.numbers_of(chunk);
  const auto first_facet = static_cast<std::uint32_t>(chunk * Numbered::kChunk);
  const auto sides = static_cast<std::uint32_t>(3 * facets.size());
  for (std::size_t v = 0; v < numbers.size(); ++v) own_[v] = !mesh.in_several_chunks(numbers[v]);
  std::fill(done_.begin(), done_.begin() + sides, std::uint8_t{0});
  std::fill(others_.begin(), others_.begin() + sides, std::uint8_t{0});
  odd.clear();
  take_sides(facets, first_facet, collapsed);
  const auto within = [&](std::uint32_t key) { return (own_[low_of(key) & kEndMask] | own_[high_of(key)]) != 0; };
  // An edge both of whose ends other chunks have too is left over with all of its sides.
  std::uint32_t near = 0;
  for (std::uint32_t i = 0; i < sides; ++i) {
    all_[near] = static_cast<std::uint16_t>(i);
    near += std::uint32_t{within(key_[i])} & (done_[i] ^ 1u);
  }
  pairs_ = 0;
  const std::uint32_t left = match({all_.data(), near}, 0x9e3779b1);
  // Those that met another edge meet each other by another hash; the few that do not again are left over.
  std::copy(rest_.begin(), rest_.begin() + left, all_.begin());
  if (left > 0) match({all_.data(), left}, 0x85ebca77);
  for (std::uint32_t i = 0; i < sides; ++i) {
    if (done_[i] != 0) [[likely]]
      continue;
    const std::uint32_t one = numbers[low_of(key_[i])], other = numbers[high_of(key_[i])];
    const bool upwards = ((key_[i] & 1) != 0) == (one < other);
    Buffer<Side>& list = within(key_[i]) ? odd : rest;
    list.push_back({std::min(one, other), std::max(one, other), first_facet + i / 3, upwards});
  }
  std::sort(odd.begin(), odd.end(), [](const Side& one, const Side& other) {
    return std::tie(one.low, one.high, one.facet) < std::tie(other.low, other.high, other.facet);
  });
  return {pair_.data(), pairs_};
}

std::uint16_t ChunkPieces::find(std::uint16_t facet) {
  while (parent_[facet] != facet) facet = parent_[facet] = parent_[parent_[facet]];
  return facet;
}

void ChunkPieces::join(std::span<const ChunkEdges::Pair> pairs, std::span<std::uint32_t> parents, std::uint32_t first) {
  std::iota(parent_.begin(), parent_.begin() + static_cast<std::ptrdiff_t>(parents.size()), std::uint16_t{0});
  for (const auto& [one, other] : pairs) {
    if (parent_[one] == parent_[other]) continue;
    const std::uint16_t a = find(one), b = find(other);
    parent_[std::max(a, b)] = std::min(a, b);
  }
  // No parent is larger than its child: every earlier entry has its root already.
  for (std::size_t f = 0; f < parents.size(); ++f) {
    parent_[f] = parent_[parent_[f]];
    parents[f] = first + parent_[f];
  }
}

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

SideLists::SideLists(std::uint32_t vertices, std::span<Buffer<Side>> sides) : begin_(vertices + std::size_t{1}, 0u) {
  for (const Buffer<Side>& some : sides) {
    for (const Side& side : some) ++begin_[side.low];
  }
  std::uint32_t end = 0;
  for (std::uint32_t& list : begin_) list = end += list;
  sides_.resize(end);
  prefer_large_pages(sides_);
  for (Buffer<Side>& some : sides) {
    for (const Side& side : some) sides_[--begin_[side.low]] = side;
    Buffer<Side>().swap(some);
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
