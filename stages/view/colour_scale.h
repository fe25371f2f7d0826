// stages/view/colour_scale.h: colours for numbers, in which equal steps look equal.
#pragma once

#include <string>

namespace lamina::view {

/// "rrggbb" of a share 0 .. 1: from dark blue over violet and orange to light yellow, ever lighter, so that it reads in grey
/// too. Lightness, hue and chroma go evenly in the colour space OKLab.
///
/// source  B. Ottosson, "A perceptual color space for image processing" (2020)
std::string scale_colour(double share);

}  // namespace lamina::view
