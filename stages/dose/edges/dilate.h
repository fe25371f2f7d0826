// stages/dose/edges/dilate.h: an image and all that is near to it, on runs.
#pragma once

#include "stages/data/runs.h"
#include "stages/dose/edges/erode.h"

namespace lamina::dose {

/// A pixel is set if and only if a pixel within reach of it is: the complement of what erode() leaves of the complement,
/// with pixels beyond the image that are not set. What would grow beyond the image is cut off.
/// cost  O(rows of the reach x changes), nothing is expanded
void dilate(const RunsView& image, const Reach& reach, Runs& result);

/// Whether dilate() would cut anything off.
bool grows_beyond(const RunsView& image, const Reach& reach);

}  // namespace lamina::dose
