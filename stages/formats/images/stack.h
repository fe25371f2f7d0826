// stages/formats/images/stack.h: a folder of layer images as a box of voxels, of which boxes are cut.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/data/voxels.h"

namespace lamina::formats {

/// Facts that a folder without a manifest does not state.
struct StackRequest {
  double pixel_um = 0, layer_um = 0;  // 0: not said; a layer is as thick as a pixel then
  int threshold = 128;                // 1 .. 255: grey from it on is bright
  bool dark = false;                  // the dark pixels are the solid, not the bright ones
};

/// A box of voxels on files. x and y rise as on the bed: the last row of an image has y 0. Voxels along z are as thick as the
/// thinnest layer; each is cut from the layer that its middle lies in.
struct ImageStack {
  std::string path;
  std::array<std::uint32_t, 3> size{};              // voxels
  std::array<double, 3> edge{};                     // nm, of a voxel
  std::array<std::uint32_t, 3> part_low{}, part{};  // where a part lies, in voxels; all of it without a manifest
  std::vector<std::uint32_t> layer_of;              // of each voxel along z
  std::function<Result<Runs>(std::uint32_t)> read;  // a layer's solid, its rows as the image has them
};

/// A folder of images .png, .tif, .tiff, .pbm, in the order of numbered_images().
/// errors  kInput: no such images, a gap in their numbering; kUsage: no size of a pixel. cost  reads the names and one image
Result<ImageStack> stack_of_images(const std::string& folder, const StackRequest& request);

/// A box of the stack. low + count within its size
/// errors  kInput: a layer cannot be read, or is of another size; 2^32 runs and more
/// cost    reads the layers of the box, one after the other; memory of one layer and the box
Result<VoxelStack> cut_box(const ImageStack& stack, const std::array<std::uint32_t, 3>& low,
                           const std::array<std::uint32_t, 3>& count);

}  // namespace lamina::formats
