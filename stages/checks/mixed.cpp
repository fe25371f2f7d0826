#include "stages/checks/mixed.h"

#include <fmt/format.h>

#include <algorithm>

namespace lamina::sanity {
namespace {

/// The layers whose planes lie in a stretch, [first, last).
LayerRange layers_in(const PowderStretch& stretch, std::span<const Nm> planes) {
  const auto below = [&](std::int64_t z) {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(planes, z) - planes.begin());
  };
  return {below(stretch.from), below(stretch.to)};
}

}  // namespace

std::vector<LayerRange> mixed_layers(std::vector<PowderStretch> stretches, std::uint32_t materials,
                                     std::span<const Nm> planes) {
  std::ranges::sort(stretches, {}, &PowderStretch::from);
  std::vector<std::uint32_t> done(materials, 0);         // layers below are counted for the material
  std::vector<std::uint32_t> powders(planes.size(), 0);  // of each layer
  for (const PowderStretch& stretch : stretches) {
    const auto [first, last] = layers_in(stretch, planes);
    std::uint32_t& from = done[stretch.material];
    for (from = std::max(from, first); from < last; ++from) ++powders[from];
  }
  std::vector<LayerRange> ranges;
  for (std::uint32_t layer = 0; layer < powders.size(); ++layer) {
    if (powders[layer] < 2) continue;
    if (ranges.empty() || ranges.back()[1] + 1 != layer) ranges.push_back({layer, layer});
    ranges.back()[1] = layer;
  }
  return ranges;
}

}  // namespace lamina::sanity
