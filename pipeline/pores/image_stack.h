// pipeline/pores/image_stack.h: folders that are image stacks: detection, the window to analyse, and comparison with a plan.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "pipeline/pores/bead_voxels.h"
#include "pipeline/pores/window_choice.h"
#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/formats/gcode/read_gcode.h"
#include "stages/formats/images/stack.h"
#include "stages/pores/registration.h"
#include "stages/support/text/json_value.h"

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

/// A window of the plan, and where it was found in the scan.
struct ScanComparison {
  Window window;            // of the plan, in the scan's voxels
  std::uint32_t range = 0;  // voxels each way that were searched
  pores::Match match;       // shift of the scan; the plan's voxels are the small box
  std::array<double, 3> shift_mm{};
  double plan_porosity = 0, scan_porosity = 0;
  double surface_per_mm = 0;  // mm2 in a mm3, mean of the two
  double wall_mm = 0;         // how far the scan's walls stand out of the plan's: porosity difference / surface
  double differing() const { return static_cast<double>(match.differing()) / static_cast<double>(window.voxels()); }
  /// Fewer than half as many voxels differ as would between boxes of these porosities that have nothing to do with each other.
  bool found() const {
    return differing() <= 0.5 * (plan_porosity * (1 - scan_porosity) + scan_porosity * (1 - plan_porosity));
  }
};

/// Places the middle of the print upon the middle of the scan and searches for the shift
/// at which they have most nearly the same solid. Nothing
/// is turned or scaled.
/// size_mm  of the window; 0: 2 mm, or what print and scan have
/// range    voxels each way, that the scan is larger than the window by
/// rules    of bead_voxels()
/// errors   kUsage: larger than the print, or than the scan less the range; those of bead_voxels() and cut_box()
/// cost     of cut_box() and pores::find_shift()
Result<ScanComparison> compare_with_scan(const formats::GcodeFile& file, const Pile& pile, const ImageStack& scan,
                                         const std::array<double, 3>& size_mm, std::uint32_t range,
                                         const bead::DepositionRules* rules = nullptr);

/// Lines that end with LF.
std::string as_text(const ScanComparison& comparison);
Json as_json(const ScanComparison& comparison);

}  // namespace lamina::pipeline
