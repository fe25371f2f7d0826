// stages/pores/closing.h: beads that lie closer than a given distance bond: their gaps are filled.
#pragma once

#include "stages/data/voxels.h"

namespace lamina::pores {

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
