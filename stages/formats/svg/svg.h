// stages/formats/svg/svg.h: slices as SVG.
#pragma once

#include <memory>

#include "stages/formats/slice_format.h"

namespace lamina::formats {

std::unique_ptr<SliceEncoder> make_svg_encoder();
/// Polygons as Slic3r's --export-svg writes them; no filling.
std::unique_ptr<SliceEncoder> make_svg_polygon_encoder();

}  // namespace lamina::formats
