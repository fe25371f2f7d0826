#include "pipeline/run/sample.h"

#include <algorithm>
#include <vector>

#include "stages/support/clocks.h"

namespace lamina::pipeline {
namespace {

constexpr std::uint32_t kSampled = 8;  // layers

bool make(const std::vector<MakerStep>& steps, std::uint32_t layer) {
  return std::ranges::all_of(steps, [&](const MakerStep& step) { return step.run(layer, Ticket()).ok(); });
}

}  // namespace

std::optional<double> sample_layers(Maker& maker, const std::array<std::uint32_t, 2>& range, const std::atomic<bool>& cancel) {
  std::vector<MakerStep> steps = maker.steps();
  std::erase_if(steps, [](const MakerStep& step) { return step.name == kStoreStep; });
  const std::uint64_t layers = range[1] - range[0], sampled = std::min<std::uint64_t>(layers, kSampled);
  double seconds = 0;
  for (std::uint64_t i = 0; i < sampled; ++i) {
    const auto layer = range[0] + static_cast<std::uint32_t>((2 * i + 1) * layers / (2 * sampled));
    if (cancel || !make(steps, std::max(layer, range[0] + 1) - 1)) return std::nullopt;
    const double start = process_seconds();
    if (!make(steps, layer)) return std::nullopt;
    seconds += process_seconds() - start;
  }
  maker.let_go(0);
  return sampled == 0 ? 0 : seconds / static_cast<double>(sampled) * static_cast<double>(layers);
}

}  // namespace lamina::pipeline
