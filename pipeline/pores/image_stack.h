// pipeline/pores/image_stack.h: detects folders that are image stacks, and selects the window to analyse.
#pragma once

#include <array>
#include <string>

#include "pipeline/pores/window_choice.h"
#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/formats/images/stack.h"

namespace lamina::pipeline {

using formats::ImageStack;
using formats::StackRequest;

/// Whether a folder has a manifest that lamina began; one of another program says nothing of images.
bool has_manifest(const std::string& folder);

/// A folder that lamina jet wrote, by its manifest, or one of numbered images.
/// errors  of stack_of_images(); kInput: the job is not finished, or wrote no images
Result<ImageStack> open_stack(const std::string& folder, const StackRequest& request);

/// A window around the middle of the part, in voxels of the stack, or larger ones.
struct StackWindow {
  WindowChoice choice;
  VoxelStack fine, coarse;  // coarse: twice as large, by majority
};
/// selection  voxel_um 0: those of the stack, else as near as whole factors allow; size_mm 0: 2 mm, or the part
/// periodic  what is said to repeat
/// errors    kUsage: larger than the part, or more than 2^31 voxels; those of cut_box()
Result<StackWindow> window_of_stack(const ImageStack& stack, const WindowRequest& selection,
                                    const std::array<bool, 3>& periodic);

}  // namespace lamina::pipeline
