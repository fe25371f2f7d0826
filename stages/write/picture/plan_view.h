// stages/write/picture/plan_view.h: one layer from above: its contours, and its beads in their true widths.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stages/data/contours.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/write/picture/canvas.h"

namespace lamina::write::picture {

struct PlanView {
  std::string title, caption;
  Box box;              // nm on the bed, what is shown, with a margin around it
  ContoursView region;  // clean contours: the solid, drawn first
  struct Shape {
    Colour ink;
    std::string name;  // for the legend
    Contours outline;  // nonzero
  };
  std::vector<Shape> shapes;   // drawn in this order, over each other
  std::uint32_t width = 2400;  // pixels
};

/// Layers side by side as PNG, all at one scale, `title` and `caption` of each below it; `box` and `width` are those of
/// the sheet. view_of is asked for one after the other, so that the shapes of one layer are held at a time.
/// errors  of view_of
Result<Buffer<std::byte>> plan_sheet(const std::string& title, std::size_t layers, const Box& box, std::uint32_t width,
                                     const std::function<Result<PlanView>(std::size_t)>& view_of);

/// The picture as PNG; each pixel is covered by the share of its area, to 1/64.
Result<Buffer<std::byte>> plan_view(const PlanView& view);

}  // namespace lamina::write::picture
