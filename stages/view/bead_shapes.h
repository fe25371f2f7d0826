// stages/view/bead_shapes.h: the areas of a layer's beads, as shapes to draw.
#pragma once

#include <span>
#include <string>

#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/view/shapes.h"

namespace lamina::view {

/// Adds the areas of planned beads to `shapes`, one per kind. errors  kInternal if Clipper refuses them
Status add_paths(const ToolpathsView& paths, LayerShapes& shapes);

/// Adds the areas of a file's beads by type, in order of first occurrence. Beads of different widths within a type have
/// different shades, four at most; widths within 0.03 mm or 5 % are one.
/// types   names of the bead types as written by any slicer; they decide the ink; "" if unknown
/// errors  kInternal if Clipper refuses them
/// cost    O(beads * types) and the union of the beads
Status add_beads(std::span<const LaidBead> beads, std::span<const std::string> types, LayerShapes& shapes);

/// Total length of all beads, mm.
double length_mm(std::span<const LaidBead> beads);

}  // namespace lamina::view
