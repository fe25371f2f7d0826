// stages/dose/edges/holes.h: the holes of a layer, on runs.
#pragma once

#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/runs.h"

namespace lamina::dose {

/// Scratch for fill_holes(); keeps its capacity.
struct HoleScratch {
  Buffer<std::uint32_t> parent;  // of each gap between runs; 0 is the outside
};

/// The image with its holes set: the pixels from which no way of steps along x and y over pixels that are not set leads out of
/// the image.
/// cost  O(changes + rows), nearly
void fill_holes(const RunsView& image, HoleScratch& scratch, Runs& filled);

}  // namespace lamina::dose
