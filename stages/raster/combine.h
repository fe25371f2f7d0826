// stages/raster/combine.h: two images of the same bed become one, as runs.
#pragma once

#include "stages/data/runs.h"

namespace lamina::raster {

enum class Combine { kEither, kBoth };  // set in one of them; set in both

/// The pixels that are set in either or in both of two images of equal size. O(runs + rows)
void combine(const RunsView& a, const RunsView& b, Combine how, Runs& out);

}  // namespace lamina::raster
