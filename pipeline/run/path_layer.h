// pipeline/run/path_layer.h: one layer's contours and toolpaths, with their statistics.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "pipeline/manifest/record.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/summary.h"
#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/formats/extrusion_format.h"

namespace lamina::pipeline {

/// Statistics of a layer's contours and stored paths, without area and the length of the paths.
PathFacts facts_of(const Sections::Work& work);

/// The text buffer of a writer, with a callback at a size limit.
struct TextBuffer {
  Buffer<char>& text;
  std::size_t maximum;          // bytes; `grown` is called after each move beyond this size
  std::function<bool()> grown;  // drains the text, or returns false to abandon the layer
};

/// Converts the stored toolpaths of a layer to moves. Stretches are expanded one at a time and never stored.
/// facts    receives the sums of the moves unless the layer is abandoned
/// returns  false if `room.grown` abandons the layer
Result<bool> deposit_moves(const Plan& plan, std::uint32_t layer, const Sections::Work& work, const TextBuffer& buffer,
                           formats::LayerMoves& out, PathFacts& facts);

}  // namespace lamina::pipeline
