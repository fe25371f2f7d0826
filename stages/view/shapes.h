// stages/view/shapes.h: what pictures of a layer show: its contours, and what its beads cover.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stages/data/contours.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"

namespace lamina::view {

/// Red, green, blue.
using Ink = std::array<std::uint8_t, 3>;

/// The ink of a kind of bead, the same in every picture.
Ink ink_of(PathKind kind);

/// The ink of one of several widths of a kind: the narrowest, step 0, is pale, the widest has the full ink.
Ink shade(const Ink& ink, std::size_t step, std::size_t steps);

struct LayerShapes {
  std::string title, caption;
  std::uint32_t index = 0;  // of the layer
  std::int64_t z = 0;       // nm: where the part is cut, or the nozzle
  Box box;                  // nm on the bed: of all layers
  Contours contours;        // of the solid; none if the job does not tell
  struct Beads {
    Ink ink;
    std::string name;
    Contours outline;  // all that these beads cover, nonzero
  };
  std::vector<Beads> beads;  // each drawn over those before it
};

/// Layers that can be drawn, one at a time.
struct LayerSeries {
  std::string name;                   // of the part or file
  std::uint32_t first = 0, last = 0;  // those that there are: [first, last)
  std::uint32_t count = 0;            // of the whole job
  std::function<Result<LayerShapes>(std::uint32_t)> layer;
};

}  // namespace lamina::view
