#include "stages/checks/mixed.h"

#include <fmt/format.h>

#include <algorithm>

namespace lamina::checks {
namespace {

/// The layers whose planes lie in a stretch, [first, last).
LayerRange layers_in(const PowderInterval& span, std::span<const Nm> planes) {
  const auto below = [&](std::int64_t z) {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(planes, z) - planes.begin());
  };
  return {below(span.from), below(span.to)};
}

}  // namespace

std::vector<LayerRange> mixed_layers(std::vector<PowderInterval> intervals, std::uint32_t materials,
                                     std::span<const Nm> planes) {
  std::ranges::sort(intervals, {}, &PowderInterval::from);
  std::vector<std::uint32_t> done(materials, 0);         // layers below are counted for the material
  std::vector<std::uint32_t> powders(planes.size(), 0);  // of each layer
  for (const PowderInterval& span : intervals) {
    const auto [first, last] = layers_in(span, planes);
    std::uint32_t& from = done[span.material];
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

}  // namespace lamina::checks
