#include "stages/load/repair/stars.h"

#include <tuple>

namespace lamina::load {
namespace {

/// Longer lists are sorted; shorter ones are put in order by moving what is out of it.
constexpr std::size_t kFew = 24;

bool before(const Side& one, const Side& other) { return std::tie(one.high, one.facet) < std::tie(other.high, other.facet); }

}  // namespace

void sort_sides(std::span<Side> sides) {
  if (sides.size() > kFew) return std::sort(sides.begin(), sides.end(), before);
  for (std::size_t i = 1; i < sides.size(); ++i) {
    const Side side = sides[i];
    std::size_t at = i;
    for (; at > 0 && before(side, sides[at - 1]); --at) sides[at] = sides[at - 1];
    sides[at] = side;
  }
}

Stars::Stars(const Numbered& mesh) : mesh_(mesh), begin_(mesh.vertices().size() + 1) {
  std::fill(begin_.begin(), begin_.end(), 0u);
  for (const Indexed::Facet& facet : mesh.facets()) {
    const Rising corners = rising(facet);
    ++begin_[corners.low];
    if (!collapsed(facet)) ++begin_[corners.mid];
  }
  // Each count becomes the end of its list, and, as the lists are filled from their ends, the beginning.
  std::uint32_t end = 0;
  for (std::uint32_t& list : begin_) list = end += list;
  facets_.resize(end);
  for (std::size_t f = mesh.facets().size(); f-- > 0;) {
    const Rising corners = rising(mesh.facets()[f]);
    facets_[--begin_[corners.low]] = static_cast<std::uint32_t>(f);
    if (!collapsed(mesh.facets()[f])) facets_[--begin_[corners.mid]] = static_cast<std::uint32_t>(f);
  }
}

bool Stars::sides_of(std::uint32_t vertex, Buffer<Side>& sides) const {
  sides.clear();
  bool all = true;
  for (const std::uint32_t f : of(vertex)) {
    const Indexed::Facet& facet = mesh_.facets()[f];
    if (collapsed(facet)) {
      all = false;
      continue;
    }
    const Rising corners = rising(facet);
    if (corners.low == vertex) {
      sides.push_back({vertex, corners.mid, f, corners.forward});
      sides.push_back({vertex, corners.high, f, !corners.forward});
    } else {
      sides.push_back({vertex, corners.high, f, corners.forward});
    }
  }
  sort_sides(sides);
  return !all;
}

void Stars::repeats_of(std::uint32_t vertex, std::vector<std::uint32_t>& repeats) const {
  std::vector<std::uint32_t> facets;
  for (const std::uint32_t f : of(vertex))
    if (rising(mesh_.facets()[f]).low == vertex) facets.push_back(f);
  const std::vector<std::uint32_t> found = repeats_among(mesh_, facets);
  repeats.insert(repeats.end(), found.begin(), found.end());
}

std::vector<std::uint32_t> repeats_among(const Numbered& mesh, std::vector<std::uint32_t>& facets) {
  const auto key = [&](std::uint32_t f) {
    const Rising corners = rising(mesh.facet(f));
    return std::tuple(corners.low, corners.mid, corners.high, corners.forward || mesh.collapsed(f));
  };
  std::sort(facets.begin(), facets.end());
  facets.erase(std::unique(facets.begin(), facets.end()), facets.end());
  std::stable_sort(facets.begin(), facets.end(), [&](std::uint32_t one, std::uint32_t other) { return key(one) < key(other); });
  std::vector<std::uint32_t> repeats;
  for (std::size_t i = 1; i < facets.size(); ++i)
    if (key(facets[i]) == key(facets[i - 1])) repeats.push_back(facets[i]);
  return repeats;
}

}  // namespace lamina::load
