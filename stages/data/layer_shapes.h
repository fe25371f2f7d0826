// stages/data/layer_shapes.h: what pictures of a layer show: its contours, and what its beads cover.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/contours.h"
#include "stages/data/mesh.h"  // Box

namespace lamina {

/// Red, green, blue.
using Ink = std::array<std::uint8_t, 3>;

struct LayerShapes {
  std::string title, caption;
  std::uint32_t index = 0;  // of the layer
  std::int64_t z = 0;       // nm: where the part is cut, or the nozzle
  Box box;                  // nm on the bed: of all layers; pictures show a margin around it
  Contours contours;        // clean: of the solid, drawn first; none if the job does not state any
  struct Beads {
    Ink ink;
    std::string name;  // for the legend
    Contours outline;  // all that these beads cover, nonzero
    std::string type;  // that shades share; "" if this is all of it
  };
  std::vector<Beads> beads;  // each drawn over those before it
};

}  // namespace lamina
