// stages/segment/layer_cut.h: how the lines of one part in one layer are cut: where the grid of thin stretches begins.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/geometry/angle.h"
#include "stages/segment/expand.h"
#include "stages/segment/predict.h"

namespace lamina::segment {

/// What a layer adds to a segmentation.
struct CutPosition {
  bool on = false;
  std::int32_t first = 0;            // number of a segmented line
  bool one_direction = true;         // segmented lines are all laid the same way
  MicroDegrees angle = 0;            // of the lines of the layer
  double shift_mm = 0;               // of the layer's pores along its lines
  std::optional<double> first_line;  // nm along across(angle + a quarter turn): a segmented line of the layers turned by 90
                                     // degrees; thin stretches have their middles on it. Absent: the grid begins where the
                                     // part does
};

/// Unit vector of an angle, in [0, half a turn) once reduced; exact for quarter turns.
std::array<double, 2> direction(MicroDegrees angle);

/// Unit vector across lines of that angle: their direction turned to the left.
std::array<double, 2> across(MicroDegrees angle);

/// Ends of a part's box along a unit vector, nm.
std::array<double, 2> reach(const Box& part, const std::array<double, 2>& along);

/// The cut of a layer. part  nm on the bed: grids of all its layers begin at its side
LayerCut layer_cut(const Segmentation& plan, const CutPosition& position, const Box& part);

/// Refuses a layer whose lines would be cut into more than 10,000,000 stretches. errors  kUsage
/// paths  of one part. layer  its number, for the message
Status check_interval_count(const Segmentation& plan, const LayerCut& cut, const ToolpathsView& paths, std::uint32_t layer);

}  // namespace lamina::segment
