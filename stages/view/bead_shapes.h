// stages/view/bead_shapes.h: what the beads of a layer cover, as shapes to look at.
#pragma once

#include <span>
#include <string>

#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/view/shapes.h"

namespace lamina::view {

/// Adds what planned beads cover to `shapes`, kind by kind. errors  kInternal if Clipper refuses them
Status add_paths(const ToolpathsView& paths, LayerShapes& shapes);

/// Adds what the beads of a file cover, by what they are for, in the order in which that is first laid; wide and narrow beads
/// of a type in different shades, four of them at most.
/// types   names of the types of beads, in the words of any slicer: they decide on the ink; "" where it says nothing
/// errors  kInternal if Clipper refuses them
/// cost    O(beads * types) and the union of the beads
Status add_beads(std::span<const LaidBead> beads, std::span<const std::string> types, LayerShapes& shapes);

/// Millimetres of all beads together.
double length_mm(std::span<const LaidBead> beads);

}  // namespace lamina::view
