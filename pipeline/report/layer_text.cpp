#include "pipeline/report/layer_text.h"

#include <fmt/format.h>

#include <algorithm>

namespace lamina::pipeline {

std::string ranges_text(std::span<const sanity::LayerRange> ranges) {
  constexpr std::size_t kMost = 6;
  const std::size_t shown = std::min(kMost, ranges.size());
  const bool one = ranges.size() == 1 && ranges[0][0] == ranges[0][1];
  std::string text = one ? "layer " : "layers ";
  for (std::size_t i = 0; i < shown; ++i) {
    if (i > 0) text += i + 1 == ranges.size() ? " and " : ", ";
    const auto [first, last] = ranges[i];
    text += first == last ? fmt::format("{}", first) : fmt::format("{} to {}", first, last);
  }
  if (shown < ranges.size()) text += fmt::format(" and {} more ranges", ranges.size() - shown);
  return text;
}

std::string refills_text(const std::vector<std::uint32_t>& refills) {
  constexpr std::size_t kTold = 6;
  if (refills.empty()) return {};
  std::string text = refills.size() == 1 ? "pauses before layer " : "pauses before layers ";
  for (std::size_t i = 0; i < std::min(kTold, refills.size()); ++i) {
    const bool last = i + 1 == refills.size();
    text += fmt::format("{}{}", i == 0 ? "" : last ? " and " : ", ", refills[i]);
  }
  if (refills.size() > kTold) text += fmt::format(" and {} more", refills.size() - kTold);
  return text + " for vats to be filled";
}

}  // namespace lamina::pipeline
