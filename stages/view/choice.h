// stages/view/choice.h: selects the layers of a job to draw.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stages/data/status.h"

namespace lamina::view {

inline constexpr std::uint32_t kMaxCells = 400;  // of a picture

/// One layer, every n-th layer, or a number of layers over the height (default 12); at most one is set.
struct LayerChoice {
  std::optional<std::uint32_t> layer, every, count;
};

/// Indices into the list of a job's layer numbers, which must not be empty.
/// errors  kUsage: several choices, no such layer, too many for a picture
/// cost    O(layers)
Result<std::vector<std::size_t>> chosen_layers(const LayerChoice& choice, const std::vector<std::uint32_t>& layers);

}  // namespace lamina::view
