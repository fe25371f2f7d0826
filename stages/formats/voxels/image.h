// stages/formats/voxels/image.h: a box of voxels as one file of bytes, for programs of tomography and flow.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/support/io/file.h"

namespace lamina::formats::voxels {

/// Which voxels of a box are meant: the set ones, or the others.
enum class VoxelPhase : std::uint8_t { kSolid, kVoid };

/// Puts a row into nx bytes: 1 where it is of that side, else 0.
inline void expand_row(std::span<const std::uint32_t> changes, VoxelPhase side, std::span<std::uint8_t> bytes) {
  const auto outside = static_cast<std::uint8_t>(side == VoxelPhase::kVoid), inside = static_cast<std::uint8_t>(1 - outside);
  std::ranges::fill(bytes, outside);
  for (std::size_t i = 0; i + 1 < changes.size(); i += 2) {
    std::fill(bytes.begin() + changes[i], bytes.begin() + changes[i + 1], inside);
  }
}

/// One file each, head and voxels; the README describes their contents.
enum class ImageKind : std::uint8_t { kNrrd, kMeta, kVti };

/// By the ending of a name: .nrrd, .mha, .vti, in any case.
std::optional<ImageKind> image_kind(std::string_view path);

/// Stands in the first 4 KiB of each file of this folder.
inline constexpr std::string_view kMark = "written by lamina";

/// Writes a byte a voxel, 1 where it is of that side, else 0: x fastest, then y, then z, as they rise. Lengths are mm; the
/// lower corner of the box is the origin, so that the middle of the first voxel is half an edge away from it.
///
/// file     open, at its beginning; the caller finishes it
/// version  of this program, stated in the head
/// errors   kOutput
/// cost     one pass; memory of some rows, never of the box
Status write_image(File& file, const VoxelView& box, VoxelPhase side, ImageKind kind, std::string_view version);

}  // namespace lamina::formats::voxels
