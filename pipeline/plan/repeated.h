// pipeline/plan/repeated.h: instances of one mesh at one position.
#pragma once

#include "pipeline/plan/scene.h"
#include "stages/data/choices.h"

namespace lamina::pipeline {

/// Keeps fewer instances of a part at one position where that changes no pixel: their number over the greatest common divisor
/// of all such numbers in a body (boxes that touch), for every winding number there is a multiple of it; by evenodd, one of an
/// odd number and two of an even one. A note of the part says how many are left out.
/// cost  O(N log N)
void drop_repeated(FillRule rule, Scene& scene);

}  // namespace lamina::pipeline
