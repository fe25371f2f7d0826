// stages/formats/svg/drawing.h: a layer as a picture in SVG, in its true size, bead widths true.
#pragma once

#include <string>

#include "stages/data/layer_shapes.h"

namespace lamina::formats::svg {

/// The file of a picture of the box and a margin around it; the classes of its paths are "solid" and the names of the beads.
std::string drawing(const LayerShapes& shapes);

}  // namespace lamina::formats::svg
