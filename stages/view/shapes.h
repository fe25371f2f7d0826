// stages/view/shapes.h: drawable layers, and the inks of their beads.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stages/data/layer_shapes.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"

namespace lamina::view {

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

}  // namespace lamina::view
