// stages/view/shapes.h: layers that can be drawn, and the inks of their beads.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "stages/data/picture/layer_shapes.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"

namespace lamina::view {

/// The ink of a kind of bead, the same in every picture.
Ink ink_of(PathKind kind);

/// The ink of one of several widths of a kind: the narrowest, step 0, is pale, the widest has the full ink.
Ink shade(const Ink& ink, std::size_t step, std::size_t steps);

/// Layers that can be drawn, one at a time.
struct LayerSeries {
  std::string name;                   // of the part or file
  std::uint32_t first = 0, last = 0;  // those that there are: [first, last)
  std::uint32_t count = 0;            // of the whole job
  std::function<Result<LayerShapes>(std::uint32_t)> layer;
};

}  // namespace lamina::view
