// stages/stokes/section.h: velocities on two planes through a flow, as pictures have them.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/voxels.h"
#include "stages/stokes/cells.h"
#include "stages/stokes/operator.h"

namespace lamina::stokes {

/// Planes through the place where a fluid is fastest along the axis that drives it, in voxels of the flow. Velocities are those
/// in the middles of voxels, 0 in the solid.
struct Section {
  std::array<std::uint32_t, 3> size{}, fastest{};  // of the box without the fluid before its ends; the place in it
  Plane across;                                    // velocity along the axis
  Plane along;  // speed; of the two planes along the axis the one that the narrower side of the pore lies in
};

/// How cells of a flow lie in the box that is drawn.
struct CellPositions {
  Buffer<std::array<std::uint32_t, 3>> at;  // of each cell; cell_positions(), turned back into the box where it was turned
  std::array<std::uint32_t, 3> size;        // of the box, voxels of the flow
  int axis;                                 // of the box, along which the force is
  int lane;                                 // of the field, with velocities along it
};

/// mean  velocity that becomes 1
/// ends  voxels of fluid before both ends of the axis: they are left out, and places count from behind the first ones
/// cost  O(cells)
Section section_of(CellPositions positions, const Cells& cells, const Field& field, double mean, std::uint32_t ends);

}  // namespace lamina::stokes
