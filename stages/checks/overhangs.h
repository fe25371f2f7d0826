// stages/checks/overhangs.h: the regions of a layer that hang over air, from the sections of this layer and the one below.
//
// With d the distance of the two sampled planes, a the support angle (0: a vertical wall, 90: a horizontal face), r = d tan(a):
//
//   far_k   = S_k minus offset(S_(k-1), r)                      where a face is flatter than a
//   hang_k  = (S_k minus S_(k-1)) within offset(far_k, r)       all that such a face adds
//
// A component of S_k that shares no area with S_(k-1) hangs as a whole. Nothing is read from facets, so the result follows
// the layers as they are made. Offsets are sharp at corners (clipping.h): where two faces steeper than a meet, their common
// edge is flatter than both and would be found by round offsets. Corners sharper than 60 degrees are cut off at r.
#pragma once

#include <vector>

#include "stages/checks/carried.h"
#include "stages/data/contours.h"
#include "stages/data/overhang.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// nm: r, of planes at a distance in nm. angle_deg  0 to 89
std::int64_t overhang_reach(double distance, double angle_deg);

/// The hanging region of a layer, as clean contours but that they may touch at corners. Rounding of sections and offsets moves
/// edges by less than 4 nm; a face at the support angle to within that hangs.
///
/// own, below  clean contours, each outer one followed by its holes
/// reach       nm, r
/// scratch     of the region below
/// errors      of clipping.h
/// cost        O(P) for P points where nothing hangs and nothing below is rough; else for a component that may hang that of
/// four
///             boolean operations with the contours below its box
Result<Contours> find_overhangs(const ContoursView& own, const ContoursView& below, std::int64_t reach, RegionBelow& scratch);

/// Area and largest pieces of a region. contours  clean, each outer one followed by its holes
LayerOverhang measure_overhang(const ContoursView& contours);

}  // namespace lamina::checks
