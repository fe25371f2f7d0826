// stages/view/choice.h: which layers of a job are drawn.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stages/data/status.h"

namespace lamina::view {

inline constexpr std::uint32_t kMostCells = 400;  // of a picture

/// One layer, every so many, or so many over the height (12 if nothing is chosen); at most one is set.
struct LayerChoice {
  std::optional<std::uint32_t> layer, every, count;
};

/// Places in the list of a job's layer numbers, which is not empty.
/// errors  kUsage: several choices, no such layer, too many for a picture
/// cost    O(layers)
Result<std::vector<std::size_t>> chosen_layers(const LayerChoice& choice, const std::vector<std::uint32_t>& layers);

}  // namespace lamina::view
