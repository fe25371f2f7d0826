// pipeline/pores/window_choice.h: which box of a print to look at.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "pipeline/pores/bead_voxels.h"
#include "stages/data/status.h"
#include "stages/formats/gcode/read_gcode.h"

namespace lamina::pipeline {

struct WindowRequest {
  double voxel_um = 10;             // edge
  std::array<double, 3> size_mm{};  // of the box; 0: what repeats
  std::optional<Box> part = {};     // that it lies in the middle of, if there are others beside it
};

struct WindowChoice {
  Window window;
  std::uint32_t first_layer = 0, layers = 0;  // in the pile
};

/// A box around the middle of the print, or of a part, of whole layers from the middle one upwards. Without a wish for its size
/// it is one period of what repeats; along an axis where nothing does, 2 mm, or eight layers, or the print. pile    not empty
/// errors  kUsage: larger than the print, or more than 2^31 voxels; kInput: a print without width; of find_repeat()
/// cost    of find_repeat()
Result<WindowChoice> choose_window(const formats::GcodeFile& file, const Pile& pile, const WindowRequest& selection);

/// The same box in voxels twice as large, as near as whole numbers allow.
Window with_half_as_many_voxels(Window window);
/// The same box, so many times as many voxels along each axis.
Window finer(Window window, std::uint32_t times);

}  // namespace lamina::pipeline
