// pipeline/run/sample.h: what the layers of a job take, by some of them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "pipeline/run/maker.h"

namespace lamina::pipeline {

/// Processor seconds of all layers of a range, by up to 8 of them, without what writes their files. Each is preceded by its
/// neighbour below, which is not counted: the first layer fills memory, and overhangs need the layer below.
/// returns  nothing if a step fails, or if it is cancelled
/// cost     up to 16 layers, one after another
std::optional<double> sample_layers(Maker& maker, const std::array<std::uint32_t, 2>& range, const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
