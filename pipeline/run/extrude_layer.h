// pipeline/run/extrude_layer.h: one layer's toolpaths through the segmentation into a writer.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>

#include "pipeline/plan/segment.h"
#include "pipeline/run/slice.h"
#include "stages/data/extruder.h"
#include "stages/segment/moves.h"
#include "stages/write/extrusion_format.h"

namespace lamina::pipeline {

/// What a layer contributes to the summary.
struct LayerExtrusion {
  write::MoveTotals totals;
  segment::SegmentCounts segments;
  segment::PlannedPorosity porosity;
  std::uint64_t points = 0;  // of the stored toolpaths

  void add(const LayerExtrusion& other);
};

/// The text that a writer appends to, and what happens when it has grown.
struct TextRoom {
  Buffer<char>& text;
  std::size_t most;             // bytes; `grown` is asked after a move that leaves more
  std::function<bool()> grown;  // whether to go on: text was taken out, or the layer is given up
};

/// The stored toolpaths of a layer become moves; stretches are expanded here and nowhere kept.
/// returns  nothing if `room.grown` gave the layer up
Result<std::optional<LayerExtrusion>> extrude_layer(const SlicePlan& plan, const SegmentPlan& segments, const Extruder& machine,
                                                    const ScheduledLayer& layer, const SlicePlan::Work& work,
                                                    const TextRoom& room, write::LayerMoves& out);

}  // namespace lamina::pipeline
