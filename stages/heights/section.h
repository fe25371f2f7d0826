// stages/heights/section.h: the area of the parts' sections, and the time of a layer that follows from it.
#pragma once

#include "stages/data/buffer.h"
#include "stages/heights/candidate_heights.h"
#include "stages/heights/heights.h"

namespace lamina::heights {

/// mm2 of the section just above each rung, of all copies: what looks down below it minus what looks up. Horizontal
/// facets up to `tolerance` above a rung count as below it. Right for closed meshes, but that a facet's area counts as
/// evenly spread over its height; never below 0.
Buffer<double> section_at_candidates(const SurfaceIndex& index, const CandidateHeights& candidate_heights, Nm tolerance);

inline double seconds_of_layer(const TimeModel& model, double section_mm2) {
  return model.seconds_per_layer + model.seconds_per_mm2 * section_mm2;
}

}  // namespace lamina::heights
