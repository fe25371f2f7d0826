#include "pipeline/run/progress_estimate.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <atomic>
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

/// By all threads, upwards together: neighbours of skins are shared.
Result<std::vector<double>> time_of_layers(const std::vector<std::uint32_t>& layers, std::uint32_t first,
                                           const std::function<Result<double>(std::uint32_t)>& seconds_of) {
  std::vector<Result<double>> found(layers.size(), 0.0);
  std::atomic<std::size_t> next{0};
  tbb::parallel_for(0, tbb::this_task_arena::max_concurrency(), [&](int) {
    for (std::size_t i; (i = next++) < layers.size();) found[i] = seconds_of(first + layers[i]);
  });
  std::vector<double> seconds;
  for (const Result<double>& of : found) {
    if (!of) return of.error();
    seconds.push_back(*of);
  }
  return seconds;
}

}  // namespace

Result<ProgressEstimate> ProgressEstimate::make(std::uint32_t first, std::uint32_t end, const std::vector<double>& raft,
                                                const std::function<Result<double>(std::uint32_t)>& seconds_of) {
  ProgressEstimate estimate;
  estimate.first_ = first;
  estimate.raft_ = static_cast<std::uint32_t>(raft.size());
  if (end <= first) return estimate;
  const std::vector<std::uint32_t> layers = sampled(end - first);
  auto sample = time_of_layers(layers, first, seconds_of);
  if (!sample) return sample.error();
  std::vector<double> seconds(end - first);
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const std::uint32_t at = layers[i], before = i > 0 ? layers[i - 1] : at;
    seconds[at] = (*sample)[i];
    for (std::uint32_t between = before + 1; between < at; ++between)
      seconds[between] = std::lerp(seconds[before], seconds[at], static_cast<double>(between - before) / (at - before));
  }
  estimate.over_.push_back(0);
  seconds.insert(seconds.begin(), raft.begin(), raft.end());
  for (const double of : seconds) estimate.over_.push_back(estimate.over_.back() + of);
  return estimate;
}

std::optional<ProgressEstimate::Progress> ProgressEstimate::at(std::uint32_t layer) const {
  if (over_.empty()) return std::nullopt;
  const double over = over_[layer], all = over_.back();
  return Progress{layer + 1, all > 0 ? static_cast<int>(100 * over / all) : 0,
                  static_cast<int>(std::lround((all - over) / 60))};
}

}  // namespace lamina::pipeline
