// stages/view/picture/swath_view.h: a layer while it is jetted: its swaths, the head over it, and the drops so far.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/levels.h"
#include "stages/data/status.h"

namespace lamina::view::picture {

struct SwathView {
  std::string title, caption;
  PixelGrid grid;
  LevelsView image;              // drops that are to be jetted: drawn light
  LevelsView fired;              // drops so far: drawn dark
  std::uint8_t maximum = 1;      // drops of a pixel, which is drawn by its share of them
  std::vector<SwathBand> bands;  // the present one is marked
  std::vector<NozzlePosition> nozzles;
  std::uint32_t width = 1200;  // of the picture
};

/// A PNG of the whole bed. errors  kInternal
Result<Buffer<std::byte>> swath_picture(const SwathView& view);

}  // namespace lamina::view::picture
