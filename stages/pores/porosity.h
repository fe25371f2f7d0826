// stages/pores/porosity.h: how much of a body is void, and how much of that is reached from outside, with beads bonded or not.
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
/// no end there, so that a part without an end counts as open. Of a body, parts that touch void outside of it are open
/// too. A part leads through the box as Parts::through() says, by its voxels within the body.
/// body    of the size of the solid; none: the whole box
/// throws  std::length_error  2^32 changes or more
/// source  Di Nisio 2022, Eq. 1 to 3: total and effective porosity
/// cost    of parts_of(), and 8 bytes a run of the void
Porosity porosity(const VoxelView& solid, const VoxelView* body = nullptr, Faces outside = kFacesZ);

/// The void of parts that lead through the box along an axis. cost  of porosity()
VoxelStack void_through(const VoxelView& solid, int axis);

// --- beads that touch: bonded, or not.

/// No plan states whether beads that touch along their sides are welded. Cusps between them, which no pore meets, are cut off
/// by good bonds and open where bonds leak: what helium finds of them is between the two.
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
/// wider than `gap`. So figures can be given for beads that bond and for those that do not. It is a morphological closing by a
/// straight line: a gap is measured along one axis only, so one aslant appears wider, and pores close from their narrow ends.
/// axis    0: x; 1: y, across beads that are deposited along x
/// gap     nm; whole voxels of it count, less than one leaves all as it is. Gaps that continue beyond the box stay, unless it
///         repeats
/// throws  std::length_error  2^32 changes or more
/// source  Serra, "Image Analysis and Mathematical Morphology" (1982)
/// cost    O(runs log(gap in voxels)) along y, O(runs) along x; slices in parallel
VoxelStack close_gaps(const VoxelView& solid, int axis, Nm gap);

}  // namespace lamina::pores
