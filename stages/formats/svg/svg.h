// stages/formats/svg/svg.h: slices as SVG, and a layer as a picture in its true size, bead widths true.
#pragma once

#include <memory>
#include <string>

#include "stages/data/layer_shapes.h"
#include "stages/formats/slice_format.h"

namespace lamina::formats {

std::unique_ptr<SliceEncoder> make_svg_encoder();
/// Polygons as Slic3r's --export-svg writes them; no filling.
std::unique_ptr<SliceEncoder> make_svg_polygon_encoder();

/// The file of a picture of the box and a margin around it; the classes of its paths are "solid" and the names of the beads.
std::string svg_drawing(const LayerShapes& shapes);

}  // namespace lamina::formats
