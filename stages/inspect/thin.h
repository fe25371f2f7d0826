// stages/inspect/thin.h: what of an image is narrower than a circle, on runs.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/inspect/bodies.h"

namespace lamina::inspect {

/// Columns on either side in the rows 0, 1, 2, ... above and below a pixel: all offsets whose length is at most a radius.
using Disc = std::vector<std::uint32_t>;

/// Decided in whole numbers: pitches in picometres. radius_nm  0 .. 10^9; empty if it holds no neighbour
Disc disc_of(const PixelGrid& grid, std::int64_t radius_nm);

/// What a layer holds of thin places.
struct ThinPlaces {
  std::uint32_t count = 0;
  std::uint64_t pixels = 0, largest = 0;  // of all; of the largest
  PixelBox box;                           // of the largest, the first of equals
};

/// Scratch of thin_places(); kept from layer to layer.
struct ThinScratch {
  Runs outside, shrunk, grown, left;
  Buffer<std::uint64_t> spans;
  Pieces pieces;
  std::uint64_t bytes() const;
};

/// Places that no disc within the image covers, as pieces that touch at sides or corners. Corners of thick bodies leave such
/// places too, of at most 0.22 radii squared at right angles and 4.3 at 20 degrees: pieces of `least_pixels` or fewer do not
/// count. What lies beyond the image's edges counts as set: a part that the bed cuts is not thin for it. cost  O(rows of the
/// disc x runs)
ThinPlaces thin_places(const RunsView& image, const Disc& disc, std::uint64_t least_pixels, ThinScratch& scratch);

/// The pixels between the runs of `image`, in rows and columns [first, last) of the window; nothing beyond it.
void complement(const RunsView& image, const PixelBox& window, Runs& result);

}  // namespace lamina::inspect
