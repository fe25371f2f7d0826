// stages/checks/thin.h: what of an image is narrower than a width, on runs.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/checks/bodies.h"
#include "stages/checks/stencils.h"
#include "stages/data/buffer.h"
#include "stages/data/runs.h"

namespace lamina::inspect {

struct ThinPlace {
  std::uint64_t pixels = 0;
  PixelBox box;
};

/// What a layer holds of thin places.
struct ThinPlaces {
  std::uint32_t count = 0;
  std::uint64_t pixels = 0;        // of all
  std::vector<ThinPlace> largest;  // at most kMost, the largest first; equal ones from the top, then from the left
  std::uint64_t bytes = 0;         // that finding them took
  static constexpr std::size_t kMost = 20;
};

/// Scratch of thin_places(); kept from layer to layer.
struct ThinScratch {
  Runs outside, anchors, grown, fits, left, chosen, waiting, pending;
  Buffer<std::uint64_t> spans;
  Pieces pieces;
  std::uint64_t bytes() const;
};

/// Places that for any of the stencils are thin: pixels that it covers nowhere where it lies on set pixels alone, and that
/// touch each other at sides or corners, more than two squares of its width. Of places within each other the largest counts.
/// Corners of thick bodies leave less: of a width of 2 r 0.22 r squared at right angles and 4.3 r squared at 20 degrees. More
/// stencils find more: never less. cost  O(rows of the last stencil x runs), and for narrower ones that of the places that are
/// left
ThinPlaces thin_places(const RunsView& image, const Stencils& stencils, ThinScratch& scratch);

/// The pixels between the runs of `image`, in rows and columns [first, last) of the window; nothing beyond it.
void complement(const RunsView& image, const PixelBox& window, Runs& result);

}  // namespace lamina::inspect
