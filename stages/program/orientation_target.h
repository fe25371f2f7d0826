// stages/program/orientation_target.h: a part whose print shows which way a machine's axes point.
#pragma once

#include <cstddef>

#include "stages/data/buffer.h"

namespace lamina::program {

/// A letter F, 20 x 30 x 3 mm, as a binary STL in mm: the stem lies along +y, the arms point to +x, the longer one is at
/// the far end (+y), and a step of 1 mm on top of the foot tells top from bottom. It has no symmetry, so that a print that
/// can be read is neither mirrored nor turned over.
Buffer<std::byte> orientation_target();

}  // namespace lamina::program
