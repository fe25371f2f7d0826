// stages/heights/steepest.h: the flattest slope between any two candidate heights, and the area of the sections there.
#pragma once

#include <span>

#include "stages/data/buffer.h"
#include "stages/heights/candidate_heights.h"
#include "stages/heights/surface.h"

namespace lamina::heights {

/// For each cell of the candidates, the largest |n_z| of the sloped facets of these parts that reach into it; so the largest
/// over any layer that ends on candidates is the largest of its cells, exactly.
/// slope  whether steps or angles follow from it
/// cost  O(facets + cells); about 32 bytes a cell while it runs, 4 after
Buffer<Steepness> steepest_in_cells(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                    const CandidateHeights& candidate_heights, Slope slope = Slope::kSteps);

/// For each candidate, the largest |n_z| of the sloped facets that a plane there cuts: lowest corner below it, highest corner
/// at or above it.
Buffer<Steepness> steepest_at_candidates(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                         const CandidateHeights& candidate_heights, Slope slope = Slope::kSteps);

/// Whether areas that face up and down add up or cancel out.
enum class Sign { kBoth, kUpMinusDown };

/// For each candidate, the mm2 of the sloped facets below it, projected along z; a facet's area counts as evenly spread over
/// its height. With kBoth, differences times the thickness add up to the mean cusp; areas are weighed by their step_share.
Buffer<double> projected_below(const SurfaceIndex& index, std::span<const PartSurface> parts,
                               const CandidateHeights& candidate_heights, Sign sign);

/// mm2 of the section just above each candidate, of all copies: downward facets below it minus upward ones. Horizontal
/// facets up to `tolerance` above a candidate count as below it. Right for closed meshes, but that a facet's area counts as
/// evenly spread over its height; never below 0.
Buffer<double> section_at_candidates(const SurfaceIndex& index, const CandidateHeights& candidate_heights, Nm tolerance);

}  // namespace lamina::heights
