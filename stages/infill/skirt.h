// stages/infill/skirt.h: beads around the parts, deposited before them, so that the nozzle is full when the first part begins.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/contours.h"
#include "stages/data/extruder.h"
#include "stages/data/mesh.h"  // Box

namespace lamina::infill {

/// Closed loops around a box, outermost first, as far apart as they are wide; each ends where it begins. Loops move closer to
/// the box where the bed ends, down to a millimetre; where there is not even so much room on all sides, one straight line
/// next to the box takes their place, on the side with the most room. Nothing if there is no room there either.
///
/// around   nm on the bed, of all parts at all heights: nothing of a part is over the beads
/// width    nm of the bead
/// bed      nm, from 0; beads are within it with their full width
/// returns  open lines of two points or more, in the order of deposition
Contours skirt_around(const Box& around, const Extruder::Skirt& settings, Nm width, std::array<std::int64_t, 2> bed);

}  // namespace lamina::infill
