// pipeline/run/extrude_layer.h: one layer's toolpaths through the segmentation into a writer.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>

#include "pipeline/run/extrude.h"
#include "pipeline/run/slice.h"

namespace lamina::pipeline {

/// What a layer contributes to the summary.
struct LayerExtrusion {
  write::MoveTotals totals;
  SegmentCounts segments;
  PlannedPorosity porosity;
  std::uint64_t points = 0;  // of the stored toolpaths

  void add(const LayerExtrusion& other);
};

/// How the lines of a part in a layer are cut.
/// errors  of infill::first_place
Result<segment::LayerCut> layer_cut(const SegmentRange& range, const infill::FillParameters& filling, const Layer& layer,
                                    const Box& part);

/// Whether thin stretches fit into the parts at all. errors  kUsage: longer than any line can be
Status check_thin_stretches(const SegmentPlan& segments, const SlicePlan& plan);

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
