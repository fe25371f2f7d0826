// tests/raster/reference.h: the bitmap contract of the design, word for word, as slowly as it reads.
#pragma once

#include <span>

#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"

namespace lamina::test {

/// Runs of one layer. Shares no code with the engines: ends of slice segments are compared with rows by
/// cross-multiplication, and the column of a crossing is searched by the sign of the plane equation at pixel centres;
/// nothing is divided and nothing is a floating-point number.
Runs reference_layer(std::span<const Triangle> triangles, const PixelGrid& grid, Nm plane, FillRule rule);

}  // namespace lamina::test
