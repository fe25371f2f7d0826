// pipeline/run/path_layer.h: one layer's contours and toolpaths, and what is told of them.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "pipeline/plan/plan.h"
#include "pipeline/run/summary.h"
#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/write/extrusion_format.h"
#include "stages/write/manifest/record.h"

namespace lamina::pipeline {

/// What contours and stored paths of a layer come to; without the length of the paths.
PathFacts facts_of(const Sections::Work& work);

/// Length of stored paths.
double length_mm(const ToolpathsView& paths);

/// The text that a writer appends to, and what happens when it has grown.
struct TextRoom {
  Buffer<char>& text;
  std::size_t most;             // bytes; `grown` is called after a move that leaves more
  std::function<bool()> grown;  // whether to go on: text was taken out, or the layer is given up
};

/// The stored toolpaths of a layer become moves; stretches are expanded here and nowhere kept.
/// facts    gains what was laid, if the layer was not given up
/// returns  false if `room.grown` gave the layer up
Result<bool> lay_moves(const Plan& plan, std::uint32_t layer, const Sections::Work& work, const TextRoom& room,
                       write::LayerMoves& out, PathFacts& facts);

/// The first layer of those that share a fault, and how many they are.
struct LayersTold {
  std::uint32_t count = 0;
  std::string first;  // "layer 12 at z 0.300 mm"
  void add(const Layer& layer);
};

}  // namespace lamina::pipeline
