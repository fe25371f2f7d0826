// pipeline/cli/pore_stack.h: lamina permeability of layer images, and the options that tell what these are.
#pragma once

#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/pores/image_stack.h"

namespace lamina::pipeline {

/// For the help: --pixel, --layer-um, --threshold, --dark, --periodic, --scan, --range.
std::vector<OptionSpec> stack_options();

/// What --window and --voxel wish for. voxel_um  where --voxel is not given
/// errors  kUsage
Result<WindowRequest> read_window_request(const Arguments& arguments, double voxel_um);

/// Permeability of a window of a folder of images.
Outcome predict_stack(const Arguments& arguments, Context& context);

/// Toolpaths beside the scan of --scan. rules  of bead_voxels()
Outcome compare_scan(const Arguments& arguments, Context& context, const formats::GcodeFile& file, const Pile& pile,
                     const bead::DepositionRules* rules);

}  // namespace lamina::pipeline
