// stages/heights/evaluate.h: the effect of any layer table on the surface of the parts.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/heights/flats.h"
#include "stages/heights/heights.h"
#include "stages/heights/surface.h"

namespace lamina::heights {

inline constexpr std::uint32_t kNoPart = UINT32_MAX;

/// One layer. Steps are those on the sloped facets that reach into it.
struct LayerFacts {
  Steepness flattest = 0;        // for angles: of the parts before they are stretched
  std::uint32_t part = kNoPart;  // the one with the flattest slope, the first if several
  std::int64_t cusp = 0;         // nm
  bool hits_flat = false;        // its top lies on a flat, within the tolerance
};

struct Evaluation {
  std::vector<LayerFacts> layers;
  std::vector<FlatHit> flats;     // all, in increasing height
  std::int64_t largest_cusp = 0;  // nm
  std::uint32_t largest_cusp_layer = 0;
  std::uint32_t above_limit = 0;   // layers with a step above the limit that was given
  double mean_cusp = 0;            // nm, over the area of all facets that are not horizontal, as printed or nominal
  std::uint32_t flats_missed = 0;  // by more than the tolerance
  std::int64_t largest_miss = 0;   // nm, of those
  std::int64_t top_miss = 0;       // nm: end of the last layer minus top of the parts
  double seconds = 0;              // by the time model; 0 without one
};

/// boundaries  nm, strictly increasing, the first is the bottom of the lowest layer; n layers have n + 1
/// cost        O(facets + parts * layers)
Evaluation evaluate(const SurfaceIndex& index, std::span<const std::int64_t> boundaries, const Options& options);

/// The boundaries of a table.
std::vector<std::int64_t> boundaries_of(const LayerTable& table);

}  // namespace lamina::heights
