// stages/view/bead_shapes.h: the areas of a layer's beads, as shapes to draw.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "stages/data/layer_shapes.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"

namespace lamina::view {

// --- drawable layers, and the inks of their beads.

/// The ink of a kind of bead, equal in all pictures.
Ink ink_of(PathKind kind);

/// The ink for one of several widths of a kind: pale for the narrowest, step 0, and full for the widest.
Ink shade(const Ink& ink, std::size_t step, std::size_t steps);

/// Drawable layers, read one at a time.
struct LayerSeries {
  std::string name;                   // of the part or file
  std::uint32_t first = 0, last = 0;  // available layers: [first, last)
  std::uint32_t count = 0;            // of the whole job
  std::function<Result<LayerShapes>(std::uint32_t)> layer;
  std::vector<std::string> notes = {};  // for a person, one line each
};

// ---

/// Adds the areas of planned beads to `shapes`, one per kind. errors  kInternal if Clipper refuses them
Status add_paths(const ToolpathsView& paths, LayerShapes& shapes);

/// Adds the areas of a file's beads by type, in order of first occurrence. Beads of different widths within a type have
/// different shades, four at most; widths within 0.03 mm or 5 % are one.
/// types   names of the bead types as written by any slicer; they decide the ink; "" if unknown
/// errors  kInternal if Clipper refuses them
/// cost    O(beads * types) and the union of the beads
Status add_beads(std::span<const DepositedBead> beads, std::span<const std::string> types, LayerShapes& shapes);

/// Total length of all beads, mm.
double length_mm(std::span<const DepositedBead> beads);

}  // namespace lamina::view
