// pipeline/show/heights_plot.h: thickness against height, beside the part's outline.
#pragma once

#include "pipeline/show/heights_study.h"
#include "stages/write/plot.h"

namespace lamina::pipeline {

/// cost  O(triangles * rows they span + layers)
write::Plot draw_study(const Scene& scene, const HeightsStudy& study);

}  // namespace lamina::pipeline
