// stages/raster/porous.h: a part of beads: stretches become beads of pixels, and the part keeps what they cover.
#pragma once

#include "stages/data/runs.h"
#include "stages/data/toolpaths.h"
#include "stages/raster/beads.h"

namespace lamina::raster {

/// Widths of beads, nm. Walls are as wide as their paths.
struct BeadWidths {
  bool segmented = false;  // what fills beside thick and thin stretches is `continuous`, else as wide as its path
  Nm thick = 0, thin = 0, continuous = 0;

  Nm of(const PathInterval& s) const;
};

/// Lays the stretches of a part in a layer, in their order.
class BeadPen {
 public:
  /// beads  gains them; outlives the pen
  BeadPen(BeadRaster& beads, const BeadWidths& widths, BeadEnds ends) : beads_(beads), widths_(widths), ends_(ends) {}

  void deposit(const PathInterval& s);

 private:
  BeadRaster& beads_;
  BeadWidths widths_;
  BeadEnds ends_;
  Nm last_width_ = 0;
  Thickness last_ = Thickness::kReference;
  PathKind last_kind_ = PathKind::kOuter;
};

/// Leaves those pixels of the image that beads cover or that lie in its shell; none is added.
/// beads    all beads of the layer, on the grid of the image
/// inner    what of the image lies below the shell, or nullptr without a shell
/// scratch  of the image's kind
void keep_beads(Runs& image, BeadRaster& beads, const Runs* inner, Runs& scratch);

}  // namespace lamina::raster
