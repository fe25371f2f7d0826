// stages/formats/voxels/surface_stl.h: the faces of voxels as one closed surface.
#pragma once

#include <cstdint>
#include <string_view>

#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/formats/voxels/image.h"
#include "stages/support/io/file.h"

namespace lamina::formats::voxels {

struct SurfaceCounts {
  std::uint64_t facets = 0;
  std::uint64_t parted_edges = 0;  // where two voxels meet in an edge alone
};

/// What write_surface() will write. cost  one pass over the rows
SurfaceCounts count_surface(const VoxelView& box, VoxelPhase side);

/// Writes the faces between voxels of that side and others as binary STL, closed by caps at the ends of the box, in mm from its
/// lower corner, corners counter-clockwise viewed from outside.
///
/// Each edge has two facets, also for programs that know corners by their coordinates alone. Where two voxels of the side meet
/// in an edge alone, four faces do: the two of each voxel bend there, as the edge's middle is in two places, a 64th of a voxel
/// along the one axis into its voxel and as much along the other out of it. So the volume stays that of the voxels, and the two
/// stay apart, as the others between them hang together. Bodies may still touch in a corner.
///
/// file     open, at its beginning; the caller finishes it
/// version  of this program, stated in the head
/// errors   kInput: no such voxel, or more facets than STL's 32 bits count; nothing is written then. kOutput
/// cost     two passes; two facets a face, more where edges are parted, of 50 bytes each; memory of nine rows
Result<SurfaceCounts> write_surface(File& file, const VoxelView& box, VoxelPhase side, std::string_view version);

}  // namespace lamina::formats::voxels
