// pipeline/output/thumbnail_text.h: a picture of the parts as comments of a G-code file, which PrusaSlicer, Moonraker and
// OctoPrint read.
//
//     ; thumbnail begin 220x124 5432      pixels; letters of base 64
//     ; iVBORw0KGgo...                    78 letters a line, a PNG file
//     ; thumbnail end
//
// Source: export_thumbnails_to_file of PrusaSlicer (src/libslic3r/GCode/Thumbnails.hpp).
#pragma once

#include <cstdint>
#include <string>

#include "pipeline/plan/scene.h"

namespace lamina::pipeline {

/// width, height  pixels, > 0
std::string thumbnail_text(const Scene& scene, std::uint32_t width, std::uint32_t height);

}  // namespace lamina::pipeline
