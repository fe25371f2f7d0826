// stages/program/orientation_target.h: a part whose print shows which way a machine's axes point.
#pragma once

#include <cstddef>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"

namespace lamina::program {

/// A letter F, 20 x 30 x 3 mm, as a binary STL in mm: the stem lies along +y, the arms point to +x, the longer one is at
/// the far end (+y), and a step of 1 mm on top of the foot tells top from bottom. It has no symmetry, so that a print that
/// can be read is neither mirrored nor turned over.
Buffer<std::byte> orientation_target();

// --- the layer that fills a machine's bed.

/// The image of a layer that sets every pixel whose centre lies on the bed.
Runs image_of_bed(const Machine& machine, const PixelGrid& grid);

}  // namespace lamina::program
