// stages/infill/waves.h: lines that are no straight ones: honeycomb and quatrefoil.
//
// Both are waves of period 3a for cells with sides a, neighbours mirrored, so that crests meet crests. A honeycomb's
// waves are trapezoids whose flat crests touch: two beads side by side, as thick as the cells' walls between. A
// quatrefoil's are cosines that stay a gap apart, so that no closed cell forms within a layer; its exact curve is not
// published, only that it is like a honeycomb with its lines kept apart (Entezari et al. 2019, design D, as reported by Di
// Nisio 2022, section 2.5).
#pragma once

#include <cstdint>

#include "stages/data/contours.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/frame.h"
#include "stages/infill/parameters.h"
#include "stages/infill/spacing.h"

namespace lamina::infill {

inline bool is_wave(Pattern pattern) { return pattern == Pattern::kHoneycomb || pattern == Pattern::kQuatrefoil; }

/// Height of a wave from trough to crest, nm.
Nm wave_height(const FillParameters& parameters);

/// Points of the waves that are clipped together in a region of so many points.
std::uint64_t wave_batch(std::size_t region_points);

/// Points of one wave over `length` nm, before it is cut at the region's edge.
std::uint64_t wave_points(const FillParameters& parameters, std::int64_t length);

/// What clipped waves may come to at most: corners of waves within the reach of the region in their strip, and where its
/// edges may cross them.
struct WaveBound {
  std::uint64_t points = 0, pieces = 0;
};
/// cost  O(edges x strips that they pass)
WaveBound bound_waves(const ContoursView& region, const FillParameters& parameters, const LinePositions& positions);

/// Appends the waves that lie in `region` (clean contours in the frame), their troughs at `places` (of positions_across).
/// `start_u` is where crests are counted from. Pieces shorter than shortest_line along u are left out.
/// errors  kUsage: too many cells; kInternal of the clipping library
/// memory  some megabytes beside the result: waves are clipped a few at a time
Status append_waves(const ContoursView& region, const FillParameters& parameters, const LinePositions& positions,
                    std::int64_t start_u, const Frame& frame, Toolpaths& out);

}  // namespace lamina::infill
