// stages/write/picture/plan_view.h: one layer from above: its contours, and its beads in their true widths.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/contours.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/write/picture/canvas.h"

namespace lamina::write::picture {

struct PlanView {
  std::string title, caption;
  Box box;                     // nm on the bed, what is shown, with a margin around it
  ContoursView region;         // clean contours: the solid, drawn first
  struct Shape {
    Colour ink;
    std::string name;          // for the legend
    Contours outline;          // nonzero
  };
  std::vector<Shape> shapes;   // drawn in this order, over each other
  std::uint32_t width = 2400;  // pixels
};

/// The picture as PNG; each pixel is covered by the share of its area, to 1/64.
Result<Buffer<std::byte>> plan_view(const PlanView& view);

}  // namespace lamina::write::picture
