// stages/view/picture/plot.h: plots as PNG.
#pragma once

#include "stages/data/buffer.h"
#include "stages/data/plot.h"
#include "stages/data/status.h"

namespace lamina::view::picture {

/// A PNG file. errors  kUsage: a size that is none, or above 20000 pixels; kInternal
Result<Buffer<std::byte>> plot_png(const Plot& plot);

}  // namespace lamina::view::picture
