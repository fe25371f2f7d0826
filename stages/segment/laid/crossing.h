// stages/segment/laid/crossing.h: thin stretches of a layer that lie under thin ones of the next, whose lines are turned by a
// quarter.
#pragma once

#include "stages/data/toolpaths.h"
#include "stages/segment/expand.h"

namespace lamina::segment {

/// Counts the thin stretches of straight lines of a part in a layer, and those whose centre line meets that of a thin stretch
/// of the same part in the layer above. Layers that are not turned by 90 degrees have none.
/// counts  receives crossing and crossed
/// memory  12 bytes a thin stretch above. cost  O((thin + thin above) log (thin above)) and the lines that a stretch crosses
void count_crossed(const ToolpathsView& paths, const LayerCut& cut, const ToolpathsView& above, const LayerCut& cut_above,
                   PoreCounts& counts);

}  // namespace lamina::segment
