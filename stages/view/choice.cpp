#include "stages/view/choice.h"

#include <fmt/format.h>

#include <algorithm>

namespace lamina::view {

Result<std::vector<std::size_t>> chosen_layers(const LayerChoice& choice, const std::vector<std::uint32_t>& layers) {
  if (choice.layer.has_value() + choice.every.has_value() + choice.count.has_value() > 1) {
    return Error{Fault::kUsage, "--layer, --every and --count exclude each other; give one of them"};
  }
  std::vector<std::size_t> chosen;
  if (choice.layer) {
    for (std::size_t i = 0; i < layers.size(); ++i) {
      if (layers[i] == *choice.layer) return std::vector<std::size_t>{i};
    }
    return Error{Fault::kUsage,
                 fmt::format("--layer {}: the job has layers {} to {}", *choice.layer, layers.front(), layers.back())};
  }
  if (const auto every = choice.every) {
    const std::size_t cells = (layers.size() + *every - 1) / *every;
    if (cells > kMaxCells) {
      return Error{Fault::kUsage, fmt::format("--every {}: {} layers are too many for a picture; give {} or more", *every,
                                              cells, (layers.size() + kMaxCells - 1) / kMaxCells)};
    }
    for (std::size_t i = 0; i < layers.size(); i += *every) chosen.push_back(i);
    return chosen;
  }
  // The middle one of each of `cells` equal stretches of the height.
  const std::size_t cells = std::min<std::size_t>(choice.count.value_or(12), layers.size());
  for (std::size_t cell = 0; cell < cells; ++cell) chosen.push_back((2 * cell + 1) * layers.size() / (2 * cells));
  return chosen;
}

}  // namespace lamina::view
