// stages/infill/solid.h: lines one pitch apart that fill a region completely, and what they leave.
//
//   region of bead centres ─> lines of each connected part, linked along its edge ─> the region less the beads
//                          ─> single beads in what is left: along edges that are nearly parallel to the lines, and in narrow
//                          places
#pragma once

#include <cstdint>

#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/fill.h"
#include "stages/infill/parameters.h"

namespace lamina::infill {

/// Appends the lines of `outlines.solid`, whose bead centres are in `outlines.solid_centres`. errors  kInternal of Clipper
/// cost  O((P + L) log (P + L)) for P points and L lines
Status append_solid(const Outlines& outlines, const FillContext& context, const FillParameters& parameters, Toolpaths& out);

struct SolidBound {
  std::uint64_t crossings = 0;   // of lines with the edge
  std::uint64_t gap_points = 0;  // of what the lines leave
};
SolidBound bound_solid(const Outlines& outlines, const FillContext& context, const FillParameters& parameters);

}  // namespace lamina::infill
