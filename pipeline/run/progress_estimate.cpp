#include "pipeline/run/progress_estimate.h"

#include <cmath>

namespace lamina::pipeline {
namespace {

/// The first and the last kEnds layers, whose skins are solid, and layers at equal distances between them; increasing.
std::vector<std::uint32_t> sampled(std::uint32_t count) {
  constexpr std::uint32_t kEnds = 4, kBetween = ProgressEstimate::kSamples - 2 * kEnds;
  std::vector<std::uint32_t> layers;
  if (count <= ProgressEstimate::kAllUpTo) {  // one after the other, skins share their neighbours: samples would be no faster
    for (std::uint32_t i = 0; i < count; ++i) layers.push_back(i);
    return layers;
  }
  for (std::uint32_t i = 0; i < kEnds; ++i) layers.push_back(i);
  const std::uint64_t gaps = count - 2 * kEnds;
  for (std::uint64_t i = 0; i < kBetween; ++i)
    layers.push_back(static_cast<std::uint32_t>(kEnds + gaps * (2 * i + 1) / (2 * kBetween)));
  for (std::uint32_t i = kEnds; i > 0; --i) layers.push_back(count - i);
  return layers;
}

}  // namespace

Result<ProgressEstimate> ProgressEstimate::make(std::uint32_t first, std::uint32_t end,
                                                const std::function<Result<double>(std::uint32_t)>& seconds_of) {
  ProgressEstimate estimate;
  estimate.first_ = first;
  if (end <= first) return estimate;
  std::vector<double> seconds(end - first);
  std::uint32_t before = 0;
  for (const std::uint32_t at : sampled(end - first)) {
    const auto of = seconds_of(first + at);
    if (!of) return of.error();
    seconds[at] = *of;
    for (std::uint32_t i = before + 1; i < at; ++i) {
      const double share = static_cast<double>(i - before) / (at - before);
      seconds[i] = std::lerp(seconds[before], seconds[at], share);
    }
    before = at;
  }
  estimate.over_.push_back(0);
  for (const double of : seconds) estimate.over_.push_back(estimate.over_.back() + of);
  return estimate;
}

std::optional<formats::LayerSurroundings::Progress> ProgressEstimate::before(std::uint32_t layer) const {
  if (over_.empty()) return std::nullopt;
  const double over = over_[layer - first_], all = over_.back();
  return formats::LayerSurroundings::Progress{layer - first_ + 1, all > 0 ? static_cast<int>(100 * over / all) : 0,
                                              static_cast<int>(std::lround((all - over) / 60))};
}

}  // namespace lamina::pipeline
