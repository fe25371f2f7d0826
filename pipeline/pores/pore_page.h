// pipeline/pores/pore_page.h: a window of pores and the flow through it, as text, JSON and plot.
#pragma once

#include <string>

#include "pipeline/pores/bead_voxels.h"
#include "pipeline/pores/predict_flow.h"
#include "pipeline/pores/window_choice.h"
#include "stages/data/plot.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Lines that end with LF; k1 in darcy and m2.
std::string as_text(const WindowChoice& choice, const PoreReport& report);

/// The same, k1 as a tensor: a row for each axis of the requested force.
Json as_json(const WindowChoice& choice, const PoreReport& report);

/// k2 along z, and what it was fitted on.
std::string as_text(const Forchheimer& inertia);
Json as_json(const Forchheimer& inertia);

/// Sections through the fastest place of the report's section; without one, through the widest pore of the middle slice.
/// source  the file or folder that they are of; its last name is printed
/// voxels  of the window: those of rasters.fine where there was a flow
/// file    whose layers are distinguished, with its pile; none: images
/// errors  of GcodeFile::layer()
/// cost    of draw_pores() and void_through()
Result<Plot> draw_window(const std::string& source, const WindowChoice& choice, const PoreReport& report,
                         const VoxelView& voxels, const formats::GcodeFile* file = nullptr, const Pile* pile = nullptr);

}  // namespace lamina::pipeline
