// stages/view/thumbnail.h: a small picture of parts on the bed, viewed obliquely from the front, for displays of printers.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/data/mesh.h"

namespace lamina::view {

/// One byte a pixel, rows from the top: a colour of thumbnail_colours().
struct Thumbnail {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
};

/// 256 colours as "rrggbb": shaded parts from 0, and the ground, the last one, into which their edges blend.
std::vector<std::string> thumbnail_colours();

/// All parts as large as fits, orthographic, shaded by the normals of facets. The same on every machine with IEEE 754 doubles.
/// meshes  with lists of triangles
/// width, height  pixels, > 0
/// cost    linear in facets and pixels; 20 bytes a pixel
Thumbnail draw_thumbnail(std::span<const Mesh> meshes, std::span<const Instance> instances, std::uint32_t width,
                         std::uint32_t height);

}  // namespace lamina::view
