// stages/infill/density.h: a filling by the share of its beads in the volume inside the walls, with solid skins below and above
// horizontal faces.
//
//   contours ─> walls, one pitch apart ─> all inside the walls ─┬─> solid, near faces ─> raster, one pitch apart
//                                                               └─> the rest ─> lines | grid | raster | gyroid
//
// The pitch is the distance at which beads have exactly the volume of the layer: cross-section / thickness. For a stadium it is
// width - thickness (1 - pi/4): neighbours overlap where their round sides leave nothing between them (Slic3r,
// Flow::spacing()).
//
// Volumes are exact up to the corners, by Steiner's formula (J. Steiner, Ueber parallele Flaechen, 1840): a raster whose lines
// end half a pitch d before the edge of a region, with every second interval of the edge as a link, has the length
// A(inset) / d + P(inset) / 2. For solid layers d is the pitch, and the volume is that of the region. For a sparse raster, d
// follows from the formula. Other sparse lines have no links and end at the edge.
//
// Sparse lines are at the same positions in every layer, also where layers differ in thickness: the width of their beads
// changes with it, so that the pitch stays.
#pragma once

#include "stages/data/contours.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/fill.h"
#include "stages/infill/parameters.h"

namespace lamina::infill {

/// The distance of beads of a width, nm, that fill a layer completely.
double solid_pitch(const FillParameters& parameters, Nm width, Nm thickness);

/// Walls, gaps between them, and all that is inside of them (`solid` at a density of 1, else `region`), of a filling by
/// density. errors  kInternal of Clipper
Result<Outlines> outlines_by_density(const ContoursView& contours, const FillContext& context,
                                     const FillParameters& parameters);

/// Whether a face so many layers (0: of this one) and nm further up or down has a skin that reaches into the layer.
bool has_skin(const FillParameters& parameters, bool up, std::uint32_t layers, std::int64_t between);
/// Whether there are skins at all.
bool has_skins(const FillParameters& parameters);
/// Layers of a thickness in the thicker skin.
std::uint32_t skin_layers(const FillParameters& parameters, Nm thickness);

/// Moves what is not covered from `region` to `solid`, with a margin of a bead, on which its lines rest.
/// covered  the region without what is near faces
/// errors   kInternal of Clipper
Status divide_skins(const ContoursView& covered, const FillContext& context, const FillParameters& parameters,
                    Outlines& outlines);

/// Appends thin walls and gaps, then what is inside the walls: solid lines, then sparse ones. errors  kInternal of Clipper
Status append_by_density(const Outlines& outlines, const FillContext& context, const FillParameters& parameters,
                         Toolpaths& out);

/// What append_by_density() may come to. cost  that of counting crossings
FillBound bound_by_density(const Outlines& outlines, const FillContext& context, const FillParameters& parameters);

}  // namespace lamina::infill
