// stages/infill/brim.h: what holds parts on the bed, and what the bed does to them: loops around the first layer, and its
// inset.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/contours.h"
#include "stages/data/status.h"

namespace lamina::infill {

/// All lengths nm.
struct BrimSettings {
  std::int64_t reach;  // from the parts to the outer edge
  Nm width;            // of a bead
  double pitch;        // from loop to loop
};

/// Closed loops around the outer contours of a layer, outermost first, each with its first point again at its end. Loops of
/// parts that are near each other are one. Loops that leave the bed are open lines within it.
///
/// layer   clean contours of all parts, without their elephant foot; holes get no brim, but islands in them do
/// bed     nm, from 0; beads are within it with their full width
/// errors  kInternal of Clipper
Result<Contours> brim_around(const ContoursView& layer, const BrimSettings& settings, std::array<std::int64_t, 2> bed);

/// The region of a first layer, which the bed presses flat, moved inwards; not where less than a bead would stay of it.
/// errors  kInternal of Clipper
Result<Contours> without_elephant_foot(const ContoursView& contours, Nm inset, Nm width);

}  // namespace lamina::infill
