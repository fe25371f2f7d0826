// stages/infill/waves.h: lines that are no straight ones: honeycomb and quatrefoil.
//
// Both are waves of period 3a for cells with sides a, neighbours mirrored, so that crests meet crests. A honeycomb's
// waves are trapezoids whose flat crests touch: two beads side by side, as thick as the cells' walls between. A
// quatrefoil's are cosines that stay a gap apart, so that no closed cell forms within a layer; its exact curve is not
// published, only that it is like a honeycomb with its lines kept apart (Entezari et al. 2019, design D, as reported by Di Nisio 2022, section 2.5).
#pragma once

#include <cstdint>

#include "stages/data/contours.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/frame.h"
#include "stages/infill/parameters.h"

namespace lamina::infill {

/// Height of a wave from trough to crest, nm.
Nm wave_height(const FillParameters& parameters);

/// Appends the waves that lie in `region` (clean contours in the frame), line 0 at the part's side `side` plus half a
/// bead, moved across by `shift`. `start_u` is where crests are counted from.
/// errors  kUsage: a quatrefoil whose lines would touch; kInternal of the clipping library
Status append_waves(const ContoursView& region, const FillParameters& parameters, Nm gap, std::int64_t side,
                    std::int64_t shift, std::int64_t start_u, const Frame& frame, Toolpaths& out);

}  // namespace lamina::infill
