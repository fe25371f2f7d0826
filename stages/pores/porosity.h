// stages/pores/porosity.h: how much of a body is void, and how much of that is reached from outside.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/voxels.h"
#include "stages/pores/parts.h"

namespace lamina::pores {

/// Counts of voxels; shares are of the body, 0 of an empty one.
struct Porosity {
  std::uint64_t body = 0;                  // voxels within which void counts
  std::uint64_t empty = 0;                 // void of them
  std::uint64_t open = 0;                  // void that is reached from outside
  std::array<std::uint64_t, 3> through{};  // void of parts that lead through the box along x, y, z
  std::uint32_t parts = 0;                 // of the void
  std::uint32_t cavities = 0;              // parts that are not open
  double voxel_mm3 = 0;

  double total() const { return share(empty); }
  double connected() const { return share(open); }
  double percolating(int axis) const { return share(through[static_cast<std::size_t>(axis)]); }

 private:
  double share(std::uint64_t voxels) const { return body == 0 ? 0 : static_cast<double>(voxels) / static_cast<double>(body); }
};

/// A part of the void is open if it touches one of the faces or, on a periodic axis of these, leads around it: such a box has
/// no end there, so that a part which goes on for ever counts as open. Of a body, parts that touch void outside of it are open
/// too. A part leads through the box as Parts::through() says, by its voxels within the body.
/// body    of the size of the solid; none: the whole box
/// throws  std::length_error  2^32 changes or more
/// source  Di Nisio 2022, Eq. 1 to 3: total and effective porosity
/// cost    of parts_of(), and 8 bytes a run of the void
Porosity porosity(const VoxelView& solid, const VoxelView* body = nullptr, Faces outside = kFacesZ);

/// The void of parts that lead through the box along an axis. cost  of porosity()
VoxelStack void_through(const VoxelView& solid, int axis);

}  // namespace lamina::pores
