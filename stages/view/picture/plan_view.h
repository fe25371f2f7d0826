// stages/view/picture/plan_view.h: one layer from above: its contours, and its beads in their true widths.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "stages/data/buffer.h"
#include "stages/data/layer_shapes.h"
#include "stages/data/status.h"

namespace lamina::view::picture {

/// Layers side by side as PNG, all at one scale, `title` and `caption` of each below it; `box` and `width` are those of
/// the sheet, the latter in pixels. shapes_of is asked for one after the other, so that the shapes of one layer are held at a
/// time. errors  of shapes_of
Result<Buffer<std::byte>> plan_sheet(const std::string& title, std::size_t layers, const Box& box, std::uint32_t width,
                                     const std::function<Result<LayerShapes>(std::size_t)>& shapes_of);

/// The picture as PNG, `width` pixels wide; each pixel is covered by the share of its area, to 1/64.
Result<Buffer<std::byte>> plan_view(const LayerShapes& shapes, std::uint32_t width);

}  // namespace lamina::view::picture
