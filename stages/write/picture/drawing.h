// stages/write/picture/drawing.h: plots, told as boxes and lines of text, become PNG.
#pragma once

#include <string>

#include "stages/data/buffer.h"
#include "stages/data/status.h"

namespace lamina::write::picture {

/// text  "drawing WIDTH HEIGHT", then one thing a line, later ones over earlier ones:
///       "box LEFT TOP WIDTH HEIGHT rrggbb", "text X BASELINE SIZE start|middle|end rrggbb LINE"
/// errors  kUsage with the number of a line that is none of these
Result<Buffer<std::byte>> drawing_png(const std::string& text);

}  // namespace lamina::write::picture
