#include "stages/load/diagnosis/repeats.h"

#include <algorithm>
#include <array>

namespace lamina::load {
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
