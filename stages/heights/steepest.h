// stages/heights/steepest.h: the flattest slope between any two rungs of a ladder.
#pragma once

#include <span>

#include "stages/data/buffer.h"
#include "stages/heights/candidate_heights.h"
#include "stages/heights/surface.h"

namespace lamina::heights {

/// For each cell of the ladder, the largest |n_z| of the sloped facets of these parts that reach into it; so the largest
/// over any layer that ends on rungs is the largest of its cells, exactly.
/// slope  whether steps or angles follow from it
/// cost  O(facets + cells); about 32 bytes a cell while it runs, 4 after
Buffer<Steepness> steepest_in_cells(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                    const CandidateHeights& candidate_heights, Slope slope = Slope::kSteps);

/// For each rung, the largest |n_z| of the sloped facets that a plane there cuts: lowest corner below it, highest corner
/// at or above it.
Buffer<Steepness> steepest_at_candidates(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                         const CandidateHeights& candidate_heights, Slope slope = Slope::kSteps);

/// Whether areas that look up and down add up or cancel out.
enum class Sign { kBoth, kUpMinusDown };

/// For each rung, the mm2 of the sloped facets below it as seen from above; a facet's area counts as evenly spread over
/// its height. With kBoth, differences times the thickness add up to the mean cusp; areas are weighed by their step_share.
Buffer<double> projected_below(const SurfaceIndex& index, std::span<const PartSurface> parts,
                               const CandidateHeights& candidate_heights, Sign sign);

}  // namespace lamina::heights
