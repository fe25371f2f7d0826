#include "stages/load/repair/stars.h"

#include <tuple>

namespace lamina::load {
namespace {

/// Longer lists are sorted; shorter ones are put in order by moving what is out of it.
constexpr std::size_t kFew = 24;

bool before(const Side& one, const Side& other) { return std::tie(one.high, one.facet) < std::tie(other.high, other.facet); }

void sort_sides(Buffer<Side>& sides) {
  if (sides.size() > kFew) return std::sort(sides.begin(), sides.end(), before);
  for (std::size_t i = 1; i < sides.size(); ++i) {
    const Side side = sides[i];
    std::size_t at = i;
    for (; at > 0 && before(side, sides[at - 1]); --at) sides[at] = sides[at - 1];
    sides[at] = side;
  }
}

}  // namespace

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
  struct Key {
    Rising corners;
    std::uint32_t facet;
  };
  std::vector<Key> keys;
  for (const std::uint32_t f : of(vertex)) {
    Rising corners = rising(mesh_.facets()[f]);
    if (corners.low != vertex) continue;
    if (collapsed(mesh_.facets()[f])) corners.forward = true;  // it has no orientation
    keys.push_back({corners, f});
  }
  const auto shape = [](const Key& key) { return std::tuple(key.corners.mid, key.corners.high, key.corners.forward); };
  std::sort(keys.begin(), keys.end(), [&](const Key& one, const Key& other) {
    return std::tuple(shape(one), one.facet) < std::tuple(shape(other), other.facet);
  });
  for (std::size_t i = 1; i < keys.size(); ++i)
    if (shape(keys[i]) == shape(keys[i - 1])) repeats.push_back(keys[i].facet);
}

}  // namespace lamina::load
