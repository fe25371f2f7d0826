// stages/write/svg/drawing.h: regions of a layer as a picture in SVG, in their true size.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/contours.h"
#include "stages/data/mesh.h"  // Box

namespace lamina::write::svg {

struct Region {
  ContoursView contours;            // nm on the bed; the nonzero rule
  std::string_view name;            // its class
  std::array<std::uint8_t, 3> ink;  // red, green, blue
};

/// The file of a picture of the box and a margin around it; each region is drawn over those before it.
std::string drawing(const Box& box, std::span<const Region> regions);

}  // namespace lamina::write::svg
