// stages/pores/bonds.h: what of the void is reached from outside if beads that touch are bonded, and if they are not.
#pragma once

#include <cstdint>

#include "stages/data/voxels.h"
#include "stages/pores/parts.h"

namespace lamina::pores {

/// Whether beads that touch along their sides are welded, no plan tells. Cusps between them, which no pore meets, are cut off
/// by good bonds and open where bonds leak: what helium finds of them lies between the two.
struct Connected {
  std::uint64_t voxels = 0;    // of the box
  std::uint64_t bonded = 0;    // void voxels that are reached where beads up to a gap apart are one
  std::uint64_t unbonded = 0;  // void voxels that are reached where low contacts let through

  double bonded_share() const { return voxels == 0 ? 0 : static_cast<double>(bonded) / static_cast<double>(voxels); }
  double unbonded_share() const { return voxels == 0 ? 0 : static_cast<double>(unbonded) / static_cast<double>(voxels); }
};

/// Bonded: gaps are closed along x and y, and the void that is left is flooded. Unbonded: the flood passes what is solid along
/// z where it is no higher than `contact`, as the line is along which the round sides of two beads meet; beads that are pressed
/// into each other further stay bonded, and so do layers.
/// gap      nm; the nearest whole number of voxels counts
/// contact  nm, below the height of a layer; whole voxels of it count
/// outside  faces from which the flood comes, as porosity() has it
/// throws   std::length_error  2^32 changes or more
/// cost     of close_gaps() and of two times parts_of(), and O(runs) for each voxel of the contact's height
Connected connected(const VoxelView& solid, Nm gap, Nm contact, Faces outside = kFacesZ);

/// The solid with gaps closed along x, then along y; see close_gaps().
/// gap  nm; the nearest whole number of voxels counts
VoxelStack bond(const VoxelView& solid, Nm gap);

// --- beads that lie closer than a given distance bond: their gaps are filled.

/// The solid, and of each slice what lies between two solid voxels of a column (along y) or row (along x) whose gap is no
/// wider than `gap`. So figures can be told for beads that bond and for those that do not. It is a morphological closing by a
/// straight line: a gap is measured along one axis only, so one aslant looks wider, and pores close from their narrow ends.
/// axis    0: x; 1: y, across beads that are laid along x
/// gap     nm; whole voxels of it count, less than one leaves all as it is. Gaps that go on beyond the box stay, unless it
///         repeats
/// throws  std::length_error  2^32 changes or more
/// source  Serra, "Image Analysis and Mathematical Morphology" (1982)
/// cost    O(runs log(gap in voxels)) along y, O(runs) along x; slices in parallel
VoxelStack close_gaps(const VoxelView& solid, int axis, Nm gap);

}  // namespace lamina::pores
