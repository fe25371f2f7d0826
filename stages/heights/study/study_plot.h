// stages/heights/study/study_plot.h: thickness against height, beside the parts' outline.
#pragma once

#include <span>
#include <string>

#include "stages/data/mesh.h"
#include "stages/data/plot.h"
#include "stages/heights/study/study.h"

namespace lamina::heights {

/// title  of the parts
/// errors  none
/// cost  O(triangles * rows they span + layers)
Plot draw_study(const std::string& title, std::span<const Mesh> meshes, std::span<const Instance> instances,
                const Study& study);

}  // namespace lamina::heights
