// stages/formats/images/placed.h: an image somewhere on the bed, in whole pixels.
#pragma once

#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/geometry/bits.h"

namespace lamina::formats {

/// Which pixels of an image the pixels of a bed take. Rows and columns are those of images.
struct Placement {
  Buffer<std::uint32_t> column;  // of the bed, for each place between two columns of the image; rises; columns + 1 entries
  Buffer<std::uint32_t> row;     // of the image, for each row of the bed from first_row on
  std::uint32_t first_row = 0;
  std::uint32_t columns = 0, rows = 0;  // of the bed
};

/// Places an image with its front left corner at a pixel of the bed, counted from the front left. What sticks out is cut off.
/// x, y  the image's pixels; those of the bed: pixel by pixel; else each pixel of the bed takes the image's pixel that its
///       centre lies in, in integers
Placement placement_of(std::uint32_t columns, std::uint32_t rows, const DotPitch& x, const DotPitch& y, const PixelGrid& grid,
                       std::int64_t at_column, std::int64_t at_row);

/// The image on the bed; `out` is another one. cost  O(changes + rows of the bed)
void position(const RunsView& image, const Placement& placement, Runs& out);
void position(const LevelsView& image, const Placement& placement, Levels& out);
/// The same of bits, all rows of the bed into a builder of its size.
void position(const BitRows& image, const Placement& placement, RunsBuilder& out);

}  // namespace lamina::formats
