// stages/formats/voxels/image.h: a box of voxels as one file of bytes, for programs of tomography and flow.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/formats/voxels/rows.h"
#include "stages/support/io/file.h"

namespace lamina::write::voxels {

/// One file each, head and voxels; the README tells what stands in them.
enum class ImageKind : std::uint8_t { kNrrd, kMeta, kVti };

/// By the ending of a name: .nrrd, .mha, .vti, in any case.
std::optional<ImageKind> image_kind(std::string_view path);

/// Stands in the first 4 KiB of each file of this folder.
inline constexpr std::string_view kMark = "written by lamina";

/// Writes a byte a voxel, 1 where it is of that side, else 0: x fastest, then y, then z, as they rise. Lengths are mm; the
/// lower corner of the box is the origin, so that the middle of the first voxel is half an edge away from it.
///
/// file     open, at its beginning; the caller finishes it
/// version  of this program, told in the head
/// errors   kOutput
/// cost     one pass; memory of some rows, never of the box
Status write_image(File& file, const VoxelView& box, Side side, ImageKind kind, std::string_view version);

}  // namespace lamina::write::voxels
