// pipeline/report/heights_plot.h: thickness against height, next to the parts' outline.
#pragma once

#include <span>
#include <string>

#include "stages/data/mesh.h"
#include "stages/data/plot.h"
#include "stages/heights/evaluate.h"

namespace lamina::pipeline {

/// title  of the parts
/// errors  none
/// cost  O(triangles * rows they span + layers)
Plot draw_study(const std::string& title, std::span<const Mesh> meshes, std::span<const Instance> instances,
                const heights::Study& study);

}  // namespace lamina::pipeline
