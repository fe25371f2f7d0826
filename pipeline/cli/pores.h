// pipeline/cli/pores.h: lamina permeability of toolpaths and of layer images, and its options.
#pragma once

#include <optional>
#include <vector>

#include "pipeline/cli/command.h"
#include "stages/data/mesh.h"

namespace lamina::pipeline {

/// For the help: --solid FILE, --void FILE and --no-flow, a window of voxels taken elsewhere. --plot serves measurements too.
std::vector<OptionSpec> window_file_options();
/// For the help: --pixel, --layer-um, --threshold, --dark, --periodic, --scan, --range.
std::vector<OptionSpec> stack_options();

/// The flow through a window of the beads of a G-code file, or a scan of it compared with its plan.
/// part  as WindowRequest takes it
Outcome predict_print(const Arguments& arguments, Context& context, const std::optional<Box>& part);

/// Permeability of a window of a folder of images.
Outcome predict_stack(const Arguments& arguments, Context& context);

}  // namespace lamina::pipeline
