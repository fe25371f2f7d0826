// stages/program/image_of_bed.h: the layer that fills a machine's bed.
#pragma once

#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"

namespace lamina::program {

/// The image of a layer that sets every pixel whose centre lies on the bed.
Runs image_of_bed(const Machine& machine, const PixelGrid& grid);

}  // namespace lamina::program
