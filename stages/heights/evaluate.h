// stages/heights/evaluate.h: the effect of any layer table on the surface of the parts, and comparisons of tables by it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/data/status.h"
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

/// One layer table and its effect on the surface.
struct Study {
  std::string name;  // "optimal", "uniform 0.05 mm", "from table.txt"
  Options options;
  std::vector<std::int64_t> boundaries;  // nm, one more than layers
  std::vector<LayerReason> reasons;      // of each layer; empty for a given table
  Plan plan;                             // its table is empty for a given one
  Evaluation evaluation;
  double plan_seconds = 0, evaluate_seconds = 0;  // wall

  std::size_t layers() const { return boundaries.size() - 1; }
  /// nm, of a layer
  std::int64_t thickness(std::size_t layer) const { return boundaries[layer + 1] - boundaries[layer]; }
};

/// Decides and evaluates layers. errors and cost  of plan_heights and evaluate
Result<Study> study(const SurfaceIndex& index, const Options& options);

/// Evaluates a given table from a file: tops in mm, one per line from the bottom up; "#" begins a comment.
/// errors  kInput, with the line: the file is unreadable or without layers, or a line is not a height above the previous
/// cost    of evaluate
Result<Study> study_table(const SurfaceIndex& index, const Options& options, const std::string& path);

/// All modes with the thicknesses and limits of `options`, and uniform layers of the least and the greatest thickness.
/// errors and cost  of study, for each
Result<std::vector<Study>> study_all_modes(const SurfaceIndex& index, const Options& options);

/// The optimal table of all parts together, then the table of each part (plan_per_part).
/// errors  of plan_per_part
Result<std::vector<Study>> study_per_part(SurfaceIndex index, Options options);

}  // namespace lamina::heights
