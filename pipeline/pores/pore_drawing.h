// pipeline/pores/pore_drawing.h: a window of pores and the flow through it as a plot.
#pragma once

#include <string>

#include "pipeline/pores/bead_voxels.h"
#include "pipeline/pores/predict_flow.h"
#include "pipeline/pores/window_choice.h"
#include "stages/data/plot.h"

namespace lamina::pipeline {

/// Sections through the fastest place of the report's section; without one, through the widest pore of the middle slice.
/// source  the file or folder that they are of; its last name is told
/// voxels  of the window: those of rasters.fine where there was a flow
/// file    whose layers are told apart, with its pile; none: images
/// errors  of GcodeFile::layer()
/// cost    of draw_pores() and void_through()
Result<Plot> draw_window(const std::string& source, const WindowChoice& choice, const PoreReport& report,
                         const VoxelView& voxels, const formats::GcodeFile* file = nullptr, const Pile* pile = nullptr);

}  // namespace lamina::pipeline
